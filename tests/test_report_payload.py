"""The data inside the page, and the command that writes it."""

import base64
import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet
import pytest

from copolicy.cards.cli import main
from copolicy.cards.episode_frames import read_frames
from copolicy.cards.facts import DatasetFacts
from copolicy.cards.report.figures_section import figures_section
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


PNG = base64.b64decode("iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAQAAAC1HAwCAAAAC0lEQVR42mNk+A8AAQUBAScY42YAAAAASUVORK5CYII=")


def figures_folder(folder: Path, task: str = "table", **changes) -> Path:
    """A folder as `copolicy-eval figures` writes it, of one figure."""
    folder.mkdir()
    (folder / "visitation.png").write_bytes(PNG)
    (folder / "visitation.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"/>', encoding="utf-8"
    )
    figure = {"title": "Visits <b>", "files": ["visitation.png", "visitation.svg"], "definition": "percent & more"}
    sources = [{"name": "A", "label": "simulated, no person took part", "episodes": 3}]
    document = {"task": task, "figures": {"visitation": {**figure, **changes}}, "sources": sources}
    (folder / "figures.json").write_text(json.dumps(document), encoding="utf-8")
    return folder


def test_figures_are_embedded_as_they_are(report_set, tmp_path, visit):
    folder = figures_folder(tmp_path / "figures")
    (folder / "plans.png").write_bytes(PNG)
    out = tmp_path / "page.html"
    assert main(["report", str(report_set), "--out", str(out), "--figures", str(folder)]) == 0
    page = visit.open(out)
    section = page.locator("#figures")
    assert "A: 3 episodes; simulated, no person took part" in section.inner_text()
    assert section.locator("figcaption").all_inner_texts() == [
        "Visits <b>: percent & more",
        "plans: not described in figures.json",
    ]
    images = section.locator("img")
    sources = [images.nth(index).get_attribute("src") or "" for index in range(images.count())]
    (first, vector), (second, bitmap) = ((source.partition(";")[0], source.partition(",")[2]) for source in sources)
    assert (first, second) == ("data:image/svg+xml", "data:image/png")
    assert base64.b64decode(vector) == (folder / "visitation.svg").read_bytes()
    assert base64.b64decode(bitmap) == PNG
    assert all(images.nth(index).evaluate("image => image.naturalWidth > 0") for index in range(2))
    assert page.locator("#contents a[href='#figures']").inner_text() == "Figures"


def test_a_figure_of_which_the_document_names_one_file_is_shown_once(tmp_path):
    folder = figures_folder(tmp_path / "figures", files=["visitation.svg"])
    (folder / "notes.png").mkdir()
    section = figures_section(folder, "table")
    assert (section.count("<img"), section.count("image/svg+xml")) == (1, 1)
    assert "not described" not in section


def test_a_page_without_figures_has_no_section_for_them(report):
    assert 'id="figures"' not in report.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("task", "changes", "text"),
    [
        ("peg", {}, "figures.json: expected figures of the task table, found peg"),
        ("table", {"files": ["other.png"]}, "expected the SVG or PNG that its figures.json names, found no other.png"),
        ("table", {"files": ["../page.png"]}, "found no page.png"),
        ("table", {"title": 3}, "with str at $.figures[...].title, found int"),
    ],
)
def test_a_folder_of_other_figures_is_refused(report_set, tmp_path, capsys, task, changes, text):
    (tmp_path / "page.png").write_bytes(PNG)
    folder, out = figures_folder(tmp_path / "figures", task, **changes), tmp_path / "page.html"
    assert main(["report", str(report_set), "--out", str(out), "--figures", str(folder)]) == 2
    assert text in capsys.readouterr().err
    assert not out.exists()
    assert main(["report", str(report_set), "--out", str(out), "--figures", str(tmp_path / "none")]) == 2
    assert "expected a folder with the figures.json of copolicy-eval figures, found no such file" in (
        capsys.readouterr().err
    )
