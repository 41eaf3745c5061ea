"""`copolicy-convert mcap` in shards: the content of one conversion, whatever the size of a shard."""

import json
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from loaded_sets import assert_same_frames, assert_same_statistics, load
from sharded_calls import EPISODES, call, content, damage, record_rest
from video_difference import video_difference

from copolicy.convert.cli import main
from copolicy.dataset.checks.checking import check_dataset, judges_data_set, judges_one_recording, rules_of
from copolicy.dataset.task import get_task


@pytest.mark.parametrize("size", [1, 4, 6, 100])
def test_shards_of_any_size_have_the_content_of_one_conversion(unsharded, tmp_path, capsys, size):
    assert main(call(unsharded / "recordings", tmp_path / "set", "--shard-episodes", str(size), "--json")) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    summary = json.loads(captured.out)
    shards = -(-EPISODES // size)
    assert (summary["episodes"], summary["shards"], summary["finished_before"]) == (EPISODES, shards, 0)
    assert content(tmp_path / "set") == content(unsharded / "whole")
    for name in ("meta/info.json", "meta/copolicy.json"):
        assert json.loads((tmp_path / "set" / name).read_text(encoding="utf-8")) == json.loads(
            (unsharded / "whole" / name).read_text(encoding="utf-8")
        )
    assert list(tmp_path.iterdir()) == [tmp_path / "set"]


def test_what_lerobot_loads_is_the_same(unsharded, tmp_path):
    assert main(call(unsharded / "recordings", tmp_path / "set", "--shard-episodes", "3", "--stats")) == 0
    merged, unsharded_set = load(tmp_path / "set"), load(unsharded / "whole")
    assert_same_frames(merged, unsharded_set, every=37)
    assert_same_statistics(merged, unsharded_set)
    statistics = json.loads((tmp_path / "set/meta/copolicy_stats.json").read_text(encoding="utf-8"))
    assert statistics["dataset"]["episodes"] == EPISODES
    assert [finding for finding in check_dataset(tmp_path / "set").findings if finding.severity == "error"] == []


def test_shards_and_the_merged_set_are_held_against_every_rule(unsharded, tmp_path, capsys):
    rules = rules_of(get_task())
    assert {*filter(judges_one_recording, rules), *filter(judges_data_set, rules)} == set(rules)
    recordings = Path(shutil.copytree(unsharded / "recordings", tmp_path / "recordings"))
    shutil.copy(recordings / "episode_000000.mcap", recordings / "episode_000009.mcap")
    assert main(call(recordings, tmp_path / "twice", "--shard-episodes", "3")) == 1
    error = capsys.readouterr().err
    first, copy = (re.escape(str(recordings / f"episode_00000{index}.mcap")) for index in (0, 9))
    assert re.fullmatch(
        rf"copolicy-convert: {copy}: expected every episode once, found episode [\w-]+ also in {first}; "
        r"nothing was written\n",
        error,
    )
    assert not (tmp_path / "twice").exists()
    (recordings / "episode_000009.mcap").unlink()
    record_rest(recordings / "episode_000004b.mcap")
    assert main(call(recordings, tmp_path / "set", "--shard-episodes", "3", "--shards", str(tmp_path / "shards"))) == 0
    findings = json.loads((tmp_path / "shards/findings.json").read_text(encoding="utf-8"))
    names = {rule.name for rule in rules if judges_one_recording(rule)}
    applied = json.loads((tmp_path / "shards/shards/00000/shard.json").read_text(encoding="utf-8"))["applied"]
    assert set(applied) == names
    # The rules of recordings give the same findings in shards as in one folder, with episodes named by index.
    labels = {path.name: str(index) for index, path in enumerate(sorted(recordings.glob("*.mcap")))}
    at_once = check_dataset(recordings).findings
    rules_at_once = {finding.rule for finding in at_once}
    expected = {(f.rule, labels[f.episode], f.figure) for f in at_once if f.episode}
    assert {("short", "5", 0.5), ("idle", "5", 1.0)} <= expected
    assert expected <= {(entry["rule"], entry["episode"], entry["figure"]) for entry in findings}
    assert {"balance", "balance_pairs"} <= {entry["rule"] for entry in findings} & rules_at_once


def test_a_shard_without_episodes_is_no_part_of_the_set(unsharded, tmp_path, capsys):
    recordings = Path(shutil.copytree(unsharded / "recordings", tmp_path / "recordings"))
    for number in (0, 1):
        damage(recordings / f"episode_{number:06d}.mcap")
    assert main(call(recordings, tmp_path / "set", "--shard-episodes", "2", "--skip-damaged")) == 0
    assert load(tmp_path / "set").num_episodes == EPISODES - 2
    for path in recordings.glob("*.mcap"):
        if path.name > "episode_000001.mcap":
            damage(path)
    capsys.readouterr()
    assert main(call(recordings, tmp_path / "none", "--shard-episodes", "2", "--skip-damaged")) == 1
    expected = f"copolicy-convert: {tmp_path / 'none'}: expected at least one episode to write, found none\n"
    assert capsys.readouterr().err == expected


def test_a_video_is_merged_with_the_same_content(unsharded, tmp_path):
    recordings = tmp_path / "recordings"
    recordings.mkdir()
    for number in range(2):
        shutil.copy(unsharded / f"recordings/episode_{number:06d}.mcap", recordings)
    flags = ("--video", "--video-size", "128x64")
    assert main(call(recordings, tmp_path / "whole", *flags)) == 0
    assert main(call(recordings, tmp_path / "set", *flags, "--shard-episodes", "1")) == 0
    same_content = content(tmp_path / "set") == content(tmp_path / "whole")
    assert same_content, video_difference(tmp_path / "set", tmp_path / "whole")
    merged, unsharded_set = load(tmp_path / "set"), load(tmp_path / "whole")
    last = unsharded_set.num_frames - 1
    assert np.array_equal(merged[last]["observation.images.scene"], unsharded_set[last]["observation.images.scene"])


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (("--executor", "slurm"), "--executor: expected sbatch on the PATH, for slurm, found 'none'"),
        (
            ("--executor", "ray"),
            "--executor: expected local or slurm, as ray is not installed (pip install ray), found 'ray'",
        ),
        (("--partition", "cpu"), "--partition: expected --executor slurm beside it, found 'local'"),
        (("--address", "auto"), "--address: expected --executor ray beside it, found 'local'"),
        (("--sbatch", "account=lab"), "--sbatch: expected --executor slurm beside it, found 'local'"),
        (
            ("--executor", "slurm", "--sbatch", "--account"),
            "--sbatch: expected KEY=VALUE, such as account=lab, found '--account'",
        ),
        (("--shard-episodes", "0"), "shard-episodes: expected at least 1, found 0"),
        (("--shards", "x", "--append"), "--append: expected no flag of a conversion in shards beside it, found True"),
    ],
)
def test_a_wrong_call(unsharded, tmp_path, capsys, monkeypatch, flags, message):
    monkeypatch.chdir(tmp_path)
    flags = [flag.replace("--account", "=lab") if flag == "--account" else flag for flag in flags]
    message = message.replace("'--account'", "'=lab'")
    root = unsharded / "whole" if "--append" in flags else tmp_path / "set"
    assert main(call(unsharded / "recordings", root, *flags)) == 2
    assert capsys.readouterr().err == f"copolicy-convert: {message}\n"
    assert not (tmp_path / "set").exists()


@pytest.fixture
def without_datatrove(monkeypatch) -> Callable[[], None]:
    def hide() -> None:
        rooms = ("copolicy.convert.scale.", "copolicy.dataset.distributed.")
        for name in [name for name in sys.modules if name.startswith(rooms)]:
            monkeypatch.delitem(sys.modules, name)
        for name in ("datatrove", "datatrove.executor", "datatrove.executor.local", "datatrove.pipeline.base"):
            monkeypatch.setitem(sys.modules, name, None)

    return hide


def test_a_missing_extra_gives_one_line(unsharded, tmp_path, capsys, without_datatrove):
    without_datatrove()
    assert main(call(unsharded / "recordings", tmp_path / "set", "--shard-episodes", "4")) == 2
    expected = (
        "copolicy-convert: datatrove is not installed: this command needs the extra, "
        "pip install 'lerobot_policy_copolicy[scale]'\n"
    )
    assert capsys.readouterr().err == expected
    assert list(tmp_path.iterdir()) == []
