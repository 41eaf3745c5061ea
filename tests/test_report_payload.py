"""The data inside the page, and the command that writes it."""

import base64
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet
import pytest

from copolicy.cards.cli import main
from copolicy.cards.episode_frames import read_frames
from copolicy.cards.facts import DatasetFacts
from copolicy.cards.report.payload import FRAME_SCALES, build_payload
from copolicy.dataset.exceptions import FileFormatError

EPISODES = 30


def test_frames_survive_their_packing(report_set):
    facts = DatasetFacts.read(report_set)
    payload = build_payload(facts, "table")
    values = np.frombuffer(base64.b64decode(payload["frames"]), "<i2").reshape(-1, len(FRAME_SCALES))
    table = values / list(FRAME_SCALES.values())
    for row, frames in zip(payload["episodes"], read_frames(facts), strict=True):
        columns = table[row["from"] : row["from"] + row["frames"]]
        np.testing.assert_allclose(columns[:, :2], frames.states[:, :2], atol=0.0251)
        np.testing.assert_allclose(np.cos(columns[:, 2]), frames.states[:, 2], atol=1e-4)
        np.testing.assert_allclose(np.sin(columns[:, 2]), frames.states[:, 3], atol=1e-4)
        np.testing.assert_allclose(columns[:, 3:7], frames.actions, atol=2e-5)
        assert frames.interaction is not None
        np.testing.assert_allclose(columns[:, 7], frames.interaction, atol=3e-5)


def test_a_page_of_376_episodes_is_under_10_mb(report, report_set):
    facts = DatasetFacts.read(report_set)
    per_episode = report.stat().st_size / len(facts.episodes)  # style and script are counted in, thirty times over
    assert facts.info["total_frames"] / len(facts.episodes) > 140
    assert 376 * per_episode < 10e6


def test_a_large_data_set_shows_fewer_frames_and_states_it(report_set):
    facts = DatasetFacts.read(report_set)
    limit = facts.info["total_frames"] * len(FRAME_SCALES) - 1  # a byte less than half of what all take
    payload = build_payload(facts, "table", frame_bytes=limit)
    assert payload["frame_step"] == 3
    assert len(base64.b64decode(payload["frames"])) <= limit
    assert [row["frames"] for row in payload["episodes"]] == [-(-e["length"] // 3) for e in facts.episodes]


def test_a_report_is_overwritten_on_request_only(report_set, tmp_path, capsys):
    out = tmp_path / "page.html"
    out.write_text("kept", encoding="utf-8")
    assert main(["report", str(report_set), "--out", str(out)]) == 2
    assert out.read_text(encoding="utf-8") == "kept"
    assert main(["report", str(report_set), "--out", str(out), "--overwrite"]) == 0
    assert out.read_text(encoding="utf-8").startswith("<!doctype html>")
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


def test_a_missing_file_of_findings_is_named(report_set, tmp_path, capsys):
    missing = tmp_path / "check.json"
    assert main(["report", str(report_set), "--out", str(tmp_path / "page.html"), "--findings", str(missing)]) == 2
    expected = f"{missing}: expected a file with the output of `copolicy-dataset check --json`, found none\n"
    assert capsys.readouterr().err == f"copolicy-cards: {expected}"
    missing.write_text("[]", encoding="utf-8")
    assert main(["report", str(report_set), "--out", str(tmp_path / "page.html"), "--findings", str(missing)]) == 2
    expected = f"{missing}: expected findings of copolicy-dataset check, found a JSON list\n"
    assert capsys.readouterr().err == f"copolicy-cards: {expected}"


def test_frames_that_contradict_the_metadata_are_refused(report_set, tmp_path):
    root = Path(shutil.copytree(report_set, tmp_path / "table"))
    (path,) = (root / "data").glob("*/*.parquet")
    table = parquet.read_table(path)
    parquet.write_table(table.slice(0, len(table) - 5), path)
    facts = DatasetFacts.read(root)
    last = facts.episodes[-1]["length"]
    with pytest.raises(
        FileFormatError, match=f"expected episode 29 with {last} frames .* found episode 29 with {last - 5}"
    ):
        list(read_frames(facts))
    path.unlink()
    with pytest.raises(FileFormatError, match=r"data: expected the frames of episode 0, found none"):
        list(read_frames(facts))
