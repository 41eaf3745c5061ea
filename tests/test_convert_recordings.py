import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.convert.cli import main
from copolicy.convert.lerobot.frame_columns import frame_columns
from copolicy.dataset.episode import EPISODE_COLUMNS, EpisodeMeta
from copolicy.dataset.recording.reader import read_episode
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.world import TableWorld


def record(path: Path, index: int, discarded: bool = False, **columns) -> Path:
    """A recording of 31 steps of random forces."""
    config = MAP_SETS["training"][index]
    world = TableWorld(config)
    path.parent.mkdir(parents=True, exist_ok=True)
    meta = replace(EpisodeMeta(f"uuid-{index}", map_id=f"training-{index:02d}", map_set="training"), **columns)
    with EpisodeRecorder(path, config, meta) as recorder:
        for action in np.random.default_rng(index).uniform(-1, 1, (31, 4)):
            world.step(action)
            recorder.step(action, world.recorded, world.reward())
        recorder.finish(index == 0, "goal" if index == 0 else "timeout", discarded=discarded)
    return path


@pytest.fixture
def recordings(tmp_path):
    """Four recordings, one of them discarded, in two sessions."""
    folder = tmp_path / "recordings"
    record(folder / "b" / "episode_0.mcap", 2)
    record(folder / "a" / "episode_1.mcap", 1, license="CC0-1.0")
    record(folder / "a" / "episode_0.mcap", 0)
    record(folder / "a" / "episode_2.mcap", 3, discarded=True)
    return folder


def convert(folder, root, *flags) -> int:
    return main(["mcap", str(folder), "--out", str(root), "--repo-id", "me/table", *flags])


def load(root: Path) -> Any:
    return LeRobotDataset("me/table", root=root)


def contents(root: Path) -> dict[str, bytes]:
    return {path.relative_to(root).as_posix(): path.read_bytes() for path in root.rglob("*") if path.is_file()}


def test_recordings_become_a_data_set(recordings, tmp_path, capsys):
    assert convert(recordings, tmp_path / "set", "--license", "cc-by-4.0", "--json") == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out) == {
        "root": str(tmp_path / "set"),
        "repo_id": "me/table",
        "fps": 10,
        "downsampling": "mean",
        "episodes": 3,
        "frames": 33,
        "successes": 1,
        "damaged_left_out": [],
        "discarded_left_out": ["episode_2.mcap"],
        "unfinished_recordings": [],
        "physics": {"angular acceleration up to pi/2 rad/s^2": 3},
        "mixed": ["license: 2 episodes cc-by-4.0; 1 episode CC0-1.0"],
        "not_verified": [],
    }
    assert captured.err == ""
    dataset = load(tmp_path / "set")
    rows = dataset.meta.episodes
    assert rows["episode_uuid"] == ["uuid-0", "uuid-1", "uuid-2"]
    assert rows["license"] == ["cc-by-4.0", "CC0-1.0", "cc-by-4.0"]
    assert max(rows["replay_drift_px"]) < 1e-6
    episode = read_episode(recordings / "a" / "episode_1.mcap")
    for name, column in frame_columns(episode, 10).items():
        stored = np.array([np.asarray(dataset[index][name]) for index in range(11, 22)])
        assert np.array_equal(stored, column), name
    for name in EPISODE_COLUMNS:
        if name not in ("license", "replay_drift_px", "achieved_hz"):
            assert rows[1][name] == getattr(episode.meta, name)
    record = json.loads((tmp_path / "set/meta/copolicy.json").read_text(encoding="utf-8"))
    assert record["converter"] == "copolicy-convert mcap"
    assert record["left_out"] == {"damaged": [], "discarded": ["episode_2.mcap"]}
    assert str(tmp_path) not in json.dumps(record)


def test_flags_do_what_they_say(recordings, tmp_path):
    root = tmp_path / "set"
    assert convert(recordings, root, "--fps", "30", "--downsampling", "first", "--keep-discarded", "--no-drift") == 0
    dataset = load(root)
    assert (dataset.fps, dataset.num_episodes, dataset.num_frames) == (30, 4, 4 * 31)
    assert dataset.meta.episodes["discarded"] == [False, False, True, False]
    assert dataset.meta.episodes["replay_drift_px"] == [None] * 4
    assert dataset.meta.features["action"]["hold"] == "first"


def test_more_processes_write_the_same_bytes(recordings, tmp_path):
    assert convert(recordings, tmp_path / "one") == 0
    assert convert(recordings, tmp_path / "two", "--workers", "2") == 0
    assert contents(tmp_path / "one") == contents(tmp_path / "two")


def test_a_damaged_file_stops_all(recordings, tmp_path, capsys):
    path = recordings / "a" / "episode_1.mcap"
    path.write_bytes(path.read_bytes()[:-3000])
    assert convert(recordings, tmp_path / "set") == 1
    captured = capsys.readouterr()
    assert captured.err.startswith(f"copolicy-convert: {path}: expected an intact and complete MCAP file, found ")
    assert captured.err.endswith("; nothing was written (--skip-damaged skips such files)\n")
    assert captured.err.count("\n") == 1
    assert [entry.name for entry in tmp_path.iterdir()] == ["recordings"]


@pytest.mark.parametrize("workers", ["1", "2"])
def test_damaged_files_are_left_out_on_demand(recordings, tmp_path, capsys, workers):
    path = recordings / "a" / "episode_1.mcap"
    path.write_bytes(path.read_bytes()[:-3000])
    (recordings / "b" / "episode_9.mcap.part").write_bytes(b"")
    assert convert(recordings, tmp_path / "set", "--skip-damaged", "--json", "--workers", workers) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["episodes"] == 2
    (message,) = summary["damaged_left_out"]
    assert message.startswith(f"{path}: expected an intact and complete MCAP file, found ")
    assert summary["unfinished_recordings"] == ["episode_9.mcap.part"]
    left_out = json.loads((tmp_path / "set/meta/copolicy.json").read_text(encoding="utf-8"))["left_out"]
    assert left_out == {"damaged": ["episode_1.mcap"], "discarded": ["episode_2.mcap"]}


def test_the_same_episode_twice_is_an_error(recordings, tmp_path, capsys):
    # In another folder, under the same name.
    first, copy = recordings / "a" / "episode_0.mcap", recordings / "b" / "episode_0.mcap"
    copy.write_bytes(first.read_bytes())
    assert convert(recordings, tmp_path / "set") == 1
    expected = f"expected every episode once, found episode uuid-0 also in {first}; nothing was written"
    assert capsys.readouterr().err == f"copolicy-convert: {copy}: {expected}\n"
    assert not (tmp_path / "set").exists()


@pytest.mark.parametrize(
    ("flags", "error"),
    [
        (("--fps", "7"), "fps: expected a divisor of 30 [1, 2, 3, 5, 6, 10, 15, 30], found 7"),
        (
            ("--repo-id", "table"),
            "--repo-id: expected USER/NAME that the Hub accepts (one slash between user and name), found 'table'",
        ),
        (("--workers", "0"), "workers: expected at least 1, found 0"),
    ],
)
def test_a_wrong_call(recordings, tmp_path, capsys, flags, error):
    assert convert(recordings, tmp_path / "set", *flags) == 2
    assert capsys.readouterr().err == f"copolicy-convert: {error}\n"


def test_folders_that_do_not_serve(recordings, tmp_path, capsys):
    assert convert(tmp_path / "nowhere", tmp_path / "set") == 2
    (tmp_path / "empty").mkdir()
    assert convert(tmp_path / "empty", tmp_path / "set") == 2
    assert convert(recordings, tmp_path / "empty") == 2
    assert capsys.readouterr().err.splitlines() == [
        f"copolicy-convert: {tmp_path / 'nowhere'}: expected a folder of recordings, found no such file or folder",
        f"copolicy-convert: {tmp_path / 'empty'}: expected at least one recording (*.mcap), found an empty folder",
        f"copolicy-convert: {tmp_path / 'empty'}: expected a path that does not exist yet, found one; "
        "nothing was overwritten",
    ]


def test_help_has_an_example(capsys):
    for command in ("mcap", "upstream"):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        assert f"copolicy-convert {command}" in capsys.readouterr().out.split("example:")[1]
