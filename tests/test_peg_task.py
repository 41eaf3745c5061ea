"""A second task, from another package, through recording and conversion: nothing there knows the table."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.collect.recording.recover import recover_file
from copolicy.collect.recording.wall_clock import WallClockAnchor
from copolicy.convert.cli import main
from copolicy.dataset.checks.read_lerobot import read_lerobot
from copolicy.dataset.checks.read_recordings import read_recordings
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.exceptions import ForeignRecordingError, InvalidValueError, ShapeError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.dataset.recording.reader import read_episode, read_metadata
from copolicy.dataset.task import get_task, installed_tasks, load_task


def record(task, path: Path, index: int = 0, steps: int | None = None):
    """An episode in which one pushes to the mark and the other brakes; its states and actions."""
    scenario = task.scenario_sets["right"][index]
    world = task.make_world(scenario)
    map_id, map_set = task.identify(scenario)
    meta = EpisodeMeta(path.stem, pair_id="a+b", map_id=map_id, map_set=map_set, license="cc-by-4.0")
    states, actions = [world.observation], []
    with EpisodeRecorder(path, scenario, meta, WallClockAnchor.simulated(10**18), task="peg") as recorder:
        while True:
            pull = 2.0 * (scenario.mark - world.position)
            actions.append(np.clip(np.array((pull, pull - 1.5 * world.velocity)), -1, 1))
            outcome = world.step(actions[-1])
            recorder.step(actions[-1], world.recorded, world.reward())
            states.append(world.observation)
            if outcome.done or len(actions) == steps:
                break
        recorder.finish(outcome.success, outcome.reason or "timeout")
    return np.array(states), np.array(actions)


def test_a_task_of_another_package_is_installed(peg):
    assert installed_tasks() == ["peg", "table"]
    assert get_task("peg") is peg


def test_an_episode_comes_back_bit_for_bit(peg, tmp_path):
    path = tmp_path / "one.mcap"
    states, actions = record(peg, path)
    episode = read_episode(path)
    assert np.array_equal(np.vstack((episode.states, episode.final_state)), states)
    assert np.array_equal(episode.actions, actions)
    assert (episode.task, episode.fps, episode.scenario) == ("peg", 20, peg.scenario_sets["right"][0])
    assert episode.settings == peg.settings_type()
    assert (episode.meta.success, episode.meta.termination_reason) == (True, "mark")
    assert (episode.meta.route_class, episode.meta.obstacle_size, episode.path) == ("", 0, None)
    info = read_metadata(path)["dataset_info"]
    assert json.loads(info["task_spec"])["state"]["names"] == ["position", "velocity"]
    assert (info["task"], info["state_units"], info["fps"]) == ("peg", "m, m/s", "20")


def test_channels_say_what_the_numbers_are(peg, tmp_path):
    from mcap.reader import make_reader

    path = tmp_path / "one.mcap"
    record(peg, path)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    channels = {channel.topic: channel.metadata for channel in summary.channels.values()}
    assert channels["/state"] == {"names": '["position", "velocity"]', "units": '["m", "m/s"]'}
    assert channels["/player/1/action"]["seat"] == "human"
    assert not [topic for topic in channels if topic.startswith(("/table", "/scene", "/interaction"))]


@pytest.mark.parametrize(
    ("arguments", "error"),
    [(((0.0, 0.0, 0.0, 0.0), (0, 0), 0), ShapeError), (((0, 0), (0, 0, 0), 0), ShapeError),
     (((0.0, 1.5), (0, 0), 0), InvalidValueError)],
)  # fmt: skip
def test_a_step_of_another_task_is_refused(peg, tmp_path, arguments, error):
    line = peg.scenario_sets["right"][0]
    with EpisodeRecorder(tmp_path / "one.mcap", line, EpisodeMeta("one"), task="peg") as recorder:
        with pytest.raises(error):
            recorder.step(*arguments)
        with pytest.raises(InvalidValueError, match="termination_reason"):
            recorder.finish(True, "goal")  # of the table


def test_a_recording_that_broke_off_is_recovered(peg, tmp_path):
    path = tmp_path / "one.mcap"
    states, _ = record(peg, path)
    broken = tmp_path / "two.mcap.part"
    content = path.read_bytes()
    broken.write_bytes(content[: len(content) * 2 // 3])
    recovery = recover_file(broken)
    assert recovery.output is not None
    episode = read_episode(recovery.output)
    assert (episode.task, episode.meta.termination_reason) == ("peg", "crash_recovered")
    assert 0 < len(episode.actions) < len(states)
    assert np.array_equal(episode.states, states[: len(episode.states)])


def test_a_task_that_is_not_installed_is_said_in_one_line(peg, tmp_path, monkeypatch):
    path = tmp_path / "one.mcap"
    record(peg, path)
    monkeypatch.undo()
    load_task.cache_clear()
    with pytest.raises(ForeignRecordingError) as error:
        read_episode(path)
    assert str(error.value) == f"{path}: expected a recording of a task that is installed (table), found one of 'peg'"


def test_recordings_become_a_data_set(peg, tmp_path, capsys):
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    folder, root = tmp_path / "recordings", tmp_path / "set"
    folder.mkdir()
    written = [record(peg, folder / f"{index}.mcap", index) for index in range(3)]
    call = ["mcap", str(folder), "--out", str(root), "--repo-id", "lab/peg"]
    assert main([*call, "--fps", "10", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["episodes"], summary["successes"], summary["physics"]) == (3, 3, {"default": 3})
    info = json.loads((root / "meta/info.json").read_text(encoding="utf-8"))
    assert info["robot_type"] == "copolicy_peg"
    assert info["features"][ACTION]["names"] == ["robot_push", "human_push"]
    assert info["features"][ACTION]["record_hz"] == 20
    document = json.loads((root / "meta/copolicy.json").read_text(encoding="utf-8"))
    assert document["task"] == json.loads(json.dumps(peg.spec.to_dict()))
    dataset = LeRobotDataset("lab/peg", root)
    first: Any = dataset[0]
    assert {key: tuple(first[key].shape) for key in (STATE, ENVIRONMENT_STATE, HUMAN_ACTION, ACTION)} == {
        STATE: (2,), ENVIRONMENT_STATE: (2,), HUMAN_ACTION: (), ACTION: (2,),  # LeRobot stores one number as it is
    }  # fmt: skip
    assert first["task"] == "Push the peg to the mark together."
    states, actions = written[0]
    np.testing.assert_array_equal(first[STATE].numpy(), states[0].astype(np.float32))
    np.testing.assert_allclose(first[ACTION].numpy(), actions[:2].mean(axis=0), rtol=1e-6)
    np.testing.assert_allclose(float(first["next.reward"]), -abs(states[2, 0] - 0.2), rtol=1e-6)
    for table in (read_recordings(folder), read_lerobot(root)):
        assert (table.task, table.damage, len(table.labels)) == (peg, (), 3)

    assert main([*call[:3], str(tmp_path / "film"), *call[4:], "--fps", "10", "--video"]) == 1
    assert "left out: the task 'peg' has no artist" in capsys.readouterr().err
    assert main([*call[:3], str(tmp_path / "odd"), *call[4:], "--fps", "15"]) == 2
    assert "expected a divisor of 20" in capsys.readouterr().err


def test_a_data_set_is_of_one_task(peg, tmp_path, capsys):
    from straight_carry import record as carry

    record(peg, tmp_path / "a.mcap")
    carry(tmp_path / "b.mcap")
    assert main(["mcap", str(tmp_path), "--out", str(tmp_path / "set"), "--repo-id", "lab/both", "--fps", "10"]) == 1
    assert "expected an episode of the task 'peg', found one of 'table'" in capsys.readouterr().err
    assert not (tmp_path / "set").exists()
