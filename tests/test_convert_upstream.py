"""The three formats of the original program: what it wrote of the same episodes must agree after import."""

import json
import math
import pickle
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from upstream_files import (
    CONFIG,
    EPISODES,
    OPTIONS,
    play,
    processed,
    random_forces,
    raw,
    write_processed,
    write_raw,
    write_store,
    zarr_places,
)

from copolicy.convert.cli import main
from copolicy.convert.upstream.build_episode import UpstreamOptions
from copolicy.convert.upstream.processed import read_processed
from copolicy.convert.upstream.raw import read_raw
from copolicy.convert.upstream.zarr_episodes import ZarrStore
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.settings_text import parse_settings_text
from copolicy.tasks.table.physics import Physics


@pytest.mark.parametrize("number", EPISODES)
def test_raw_rows_are_moved_to_the_state_before_the_action(examples, number):
    episode = raw(examples, number)
    path = examples / "raw" / "trajectories" / f"ep_{number}.pkl"
    rows = pickle.loads(path.read_bytes())
    next_states = np.array([row[:6] for row in rows], float)
    assert np.array_equal(episode.states[1:, :2], next_states[:-1, :2])
    assert np.array_equal(episode.final_state[:2], next_states[-1, :2])
    assert np.array_equal(episode.states[1:, 4:], next_states[:-1, 3:])
    assert episode.states[0] == pytest.approx([*episode.map_config.start[:2], math.cos(3.14), math.sin(3.14), 0, 0, 0])
    assert np.array_equal(episode.actions, np.array([row[6] for row in rows]))
    assert episode.map_config.goal == tuple(rows[0][12])
    assert episode.map_config.obstacles == tuple(map(tuple, rows[0][13:-6]))
    assert episode.meta.replay_drift_px < 1e-9
    assert (episode.meta.success, episode.meta.source) == (bool(rows[-1][9]), "upstream")
    assert episode.meta.termination_reason == ("collision_obstacle" if number == 11 else "goal")
    assert episode.meta.quality_flags == ""
    assert episode.meta.map_set == "training"
    assert episode.meta.duration_s == len(rows) / 30
    assert (episode.meta.pair_id, episode.meta.controller_0, episode.meta.controller_1) == ("", "", "")
    assert episode.notes == (f"from trajectories/ep_{number}.pkl, angular limit pi/2",)


@pytest.mark.parametrize("number", EPISODES)
def test_processed_files_agree_with_raw_files(examples, number):
    episode, expected = processed(examples, number), raw(examples, number)
    # Positions are stored in single precision; velocities are not stored at all.
    assert np.abs(episode.states[:, :2] - expected.states[:, :2]).max() < 1e-4
    assert np.abs(episode.states[:, 2:4] - expected.states[:, 2:4]).max() < 1e-6
    assert np.abs(episode.states[:, 4:6] - expected.states[:, 4:6]).max() < 1e-5
    assert np.abs(episode.states[:, 6] - expected.states[:, 6]).max() < 1e-6
    assert np.abs(episode.final_state - expected.final_state).max() < 1e-4
    assert np.abs(episode.actions - expected.actions).max() < 1e-7
    assert episode.meta.replay_drift_px < 1e-3
    assert episode.meta.termination_reason == expected.meta.termination_reason
    assert episode.map_config == expected.map_config  # of ep_1, too, whose file has another episode's map


@pytest.mark.parametrize("number", EPISODES)
def test_the_zarr_store_agrees_with_raw_files(examples, number):
    store = ZarrStore(examples / "table_10Hz.zarr")
    episode, expected = store.read(zarr_places(examples)[number], OPTIONS), raw(examples, number)
    assert episode.fps == 10
    # The store's numbers are those of single precision.
    assert np.abs(episode.states[:, :2] - expected.states[::3, :2]).max() < 1e-4
    assert np.abs(episode.states[:, 2:4] - expected.states[::3, 2:4]).max() < 1e-6
    assert np.abs(episode.states[:, 4:6] - expected.states[::3, 4:6]).max() < 1e-5
    assert np.abs(episode.states[:, 6] - expected.states[::3, 6]).max() < 1e-6
    assert np.abs(episode.actions - expected.actions[::3]).max() < 1e-7
    assert episode.meta.termination_reason == expected.meta.termination_reason
    assert math.isnan(episode.meta.replay_drift_px)
    assert 0 <= expected.meta.duration_s - episode.meta.duration_s < 0.1
    if number != 1:
        assert episode.map_config == expected.map_config
        assert episode.meta.quality_flags == ""


def test_a_store_with_a_reward_column_reads_the_same(examples, tmp_path):
    shutil.copytree(examples / "table_10Hz.zarr", tmp_path / "store")
    original = ZarrStore(tmp_path / "store")
    metadata = json.loads((tmp_path / "store/data/obs/.zarray").read_text(encoding="utf-8"))
    metadata |= {"shape": [1933, 19], "chunks": [1933, 19], "compressor": None}
    (tmp_path / "store/data/obs/.zarray").write_text(json.dumps(metadata), encoding="utf-8")
    (tmp_path / "store/data/obs/0.0").write_bytes(np.column_stack((original.obs, np.zeros(1933))).tobytes())
    extended = ZarrStore(tmp_path / "store")
    assert repr(extended.read(0, OPTIONS).meta) == repr(original.read(0, OPTIONS).meta)
    assert np.array_equal(extended.read(0, OPTIONS).states, original.read(0, OPTIONS).states)


@pytest.mark.parametrize("name", ["pi/2", "pi/8"])
def test_the_angular_limit_is_found_in_every_format(tmp_path, name):
    physics = Physics(angular_acceleration_limit={"pi/2": math.pi / 2, "pi/8": math.pi / 8}[name])
    states, actions = play(random_forces(90), physics)
    path = write_raw(tmp_path, states, actions)
    episode = read_raw(path, OPTIONS)
    assert episode.notes[0].endswith(f"angular limit {name}")
    assert "dynamics_mismatch" not in episode.meta.quality_flags
    assert np.abs(episode.states[0, :2] - CONFIG.start[:2]).max() < 1e-9
    mismatched = read_raw(path, UpstreamOptions("pi/8" if name == "pi/2" else "pi/2"))
    assert mismatched.meta.quality_flags == "dynamics_mismatch"
    assert (parse_settings_text(episode.meta.physics), mismatched.meta.physics) == (physics, "")
    assert episode.meta.obstacle_size == OPTIONS.obstacle_size

    cosine, sine = np.cos(states[1:, 2:3]), np.sin(states[1:, 2:3])
    pose = np.hstack((states[1:, :2], cosine, sine))
    conditions = np.tile([*CONFIG.start, *CONFIG.goal, 1, 1, 1], (90, 1))
    write_processed(tmp_path / "p" / "p.npz", pose, actions, conditions)
    single = read_processed(tmp_path / "p" / "p.npz", OPTIONS)
    assert single.notes[0].endswith(f"angular limit {name}")
    assert np.abs(single.states - episode.states).max() < 1e-4
    assert parse_settings_text(single.meta.physics) == physics

    write_store(tmp_path / "store", states, actions)
    tenth = ZarrStore(tmp_path / "store").read(0, OPTIONS)
    assert tenth.notes[0].endswith(f"angular limit {name}")
    assert tenth.meta.quality_flags == ""
    assert np.abs(tenth.states - episode.states[::3]).max() < 1e-9
    assert parse_settings_text(tenth.meta.physics) == physics


def test_rows_that_tell_no_angular_limit_leave_the_physics_unknown(tmp_path):
    forces = random_forces(90)[:, :2]
    path = write_raw(tmp_path, *play(np.hstack((forces, forces))))  # without torque
    episode = read_raw(path, OPTIONS)
    assert (episode.meta.physics, episode.meta.quality_flags) == ("", "")
    assert episode.notes[0].endswith("angular limit pi/2, which the rows do not determine")
    stated = read_raw(path, UpstreamOptions("pi/8"))
    assert parse_settings_text(stated.meta.physics) == Physics(angular_acceleration_limit=math.pi / 8)


def test_rows_that_were_skipped_are_refused(tmp_path):
    states, actions = play(random_forces(60))
    pose = np.hstack((states[1:, :2], np.cos(states[1:, 2:3]), np.sin(states[1:, 2:3])))
    conditions = np.tile([*CONFIG.start, *CONFIG.goal, 1, 1, 1], (60, 1))
    write_processed(tmp_path / "p" / "p.npz", pose[::3], actions[::3], conditions[::3])
    with pytest.raises(
        FileFormatError, match=r"p.npz: expected consecutive steps of 1/30 s that follow from the actions"
    ):
        read_processed(tmp_path / "p" / "p.npz", OPTIONS)


def test_forces_beyond_the_bound_act_as_the_bound_did(tmp_path):
    episode = read_raw(write_raw(tmp_path, *play(3 * random_forces(30))), OPTIONS)
    assert np.abs(episode.actions).max() == 1
    assert episode.meta.replay_drift_px < 1e-9
    assert "dynamics_mismatch" not in episode.meta.quality_flags


def test_a_success_flag_that_the_contact_test_denies_is_flagged(tmp_path):
    states, actions = play(random_forces(30))
    episode = read_raw(write_raw(tmp_path, states, actions, success=True), OPTIONS)
    assert (episode.meta.success, episode.meta.termination_reason) == (False, "unknown")
    assert episode.meta.quality_flags == "outcome_differs"
    assert episode.notes[-1] == "the file states success=True, the contact test gives False"


@pytest.mark.parametrize(
    ("edit", "found"),
    [
        (lambda rows: rows[1:], "expected steps numbered 1 to 19, found 2 to 20"),
        (lambda rows: [[*row[:11], 0.1, *row[12:]] for row in rows], "expected steps of 1/30 s, found 0.1 to 0.1 s"),
        (lambda rows: [*rows[:-1], rows[-1][:-1]], "expected rows of one length of at least 19, found"),
        (lambda rows: {"rows": rows}, "expected a list of rows, each a list, found dict"),
        (lambda rows: [[np.nan, *row[1:]] for row in rows], "expected finite numbers, found nan or inf"),
        (lambda rows: [[*row[:6], np.zeros(3), *row[7:]] for row in rows], "four forces, a goal and obstacles"),
    ],
)
def test_rows_of_another_kind_are_refused(tmp_path, edit, found):
    path = write_raw(tmp_path, *play(random_forces(20)))
    path.write_bytes(pickle.dumps(edit(pickle.loads(path.read_bytes())), 4))
    with pytest.raises(FileFormatError) as error:
        read_raw(path, OPTIONS)
    assert str(error.value).startswith(str(path))
    assert found in str(error.value)


def load(root: Path) -> Any:
    return LeRobotDataset("me/table", root=root)


def convert(path: Path, root: Path, *flags: str) -> int:
    return main(["upstream", str(path), "--out", str(root), "--repo-id", "me/table", *flags])


@pytest.mark.parametrize(
    ("name", "form", "episodes", "frames", "flags"),
    [
        ("raw", "raw", 6, 974, {}),
        ("processed_npz", "processed", 6, 974, {"map_mismatch": 1, "map_recovered": 1}),
        (
            "table_10Hz.zarr", "zarr", 11, 1933,
            {"map_mismatch": 1, "goal_recovered": 1, "excluded: map_mismatch": 1},
        ),
    ],
)  # fmt: skip
def test_each_format_becomes_a_data_set(examples, tmp_path, capsys, name, form, episodes, frames, flags):
    assert convert(examples / name, tmp_path / "set", "--json", "--license", "cc-by-4.0") == 0
    captured = capsys.readouterr()
    summary = json.loads(captured.out)
    assert captured.err == ""
    assert (summary["format"], summary["episodes"], summary["frames"]) == (form, episodes, frames)
    assert summary["downsampling"] == ("first" if form == "zarr" else "mean")
    assert summary["successes"] == episodes - 1
    assert summary["quality_flags"] == flags
    assert summary["excluded"] == (form == "zarr")
    assert len(summary["noticed"]) == bool(flags)
    dataset = load(tmp_path / "set")
    assert dataset.num_frames == frames
    rows = dataset.meta.episodes
    assert set(rows["source"]) == {"upstream"}
    assert set(rows["license"]) == {"cc-by-4.0"}
    assert len(set(rows["episode_uuid"])) == episodes
    successes = [bool(dataset[end - 1]["next.success"]) for end in rows["dataset_to_index"]]
    assert successes == rows["success"]
    notes = json.loads((tmp_path / "set/meta/copolicy.json").read_text(encoding="utf-8"))["notes"]
    assert set(notes) == set(rows["episode_uuid"])


def test_files_come_in_the_order_of_their_numbers(examples, tmp_path):
    assert convert(examples / "raw", tmp_path / "set", "--fps", "30") == 0
    lengths = load(tmp_path / "set").meta.episodes["length"]
    assert lengths == [478, 542, 660, 636, 478, 123]  # 1, 2, 3, 4, 8, 11


def test_a_store_has_one_rate_and_one_hold(examples, tmp_path, capsys):
    store = examples / "table_10Hz.zarr"
    assert convert(store, tmp_path / "set", "--fps", "30") == 2
    assert convert(store, tmp_path / "set", "--downsampling", "mean") == 2
    assert capsys.readouterr().err.splitlines() == [
        "copolicy-convert: fps: expected 10: the store holds every third step only, found 30",
        "copolicy-convert: downsampling: expected 'first': the store holds the first of three actions only, "
        "found 'mean'",
    ]
    assert list(tmp_path.iterdir()) == []


def test_damaged_files_stop_the_conversion_or_are_left_out(examples, tmp_path, capsys):
    shutil.copytree(examples / "raw", tmp_path / "raw")
    path = tmp_path / "raw" / "trajectories" / "ep_3.pkl"
    path.write_bytes(path.read_bytes()[:5000])
    assert convert(tmp_path / "raw", tmp_path / "set") == 1
    assert capsys.readouterr().err == (
        f"copolicy-convert: {path}: expected a pickle of NumPy arrays and plain values, found pickle data was "
        "truncated; nothing was written (--skip-damaged skips such files)\n"
    )
    assert not (tmp_path / "set").exists()
    assert convert(tmp_path / "raw", tmp_path / "set", "--skip-damaged", "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["episodes"] == 5
    assert len(summary["damaged_left_out"]) == 1
    record = json.loads((tmp_path / "set/meta/copolicy.json").read_text(encoding="utf-8"))
    assert record["left_out"]["damaged"] == ["trajectories/ep_3.pkl"]


def test_a_folder_must_hold_one_format(examples, tmp_path, capsys):
    assert convert(examples, tmp_path / "set") == 2
    assert convert(tmp_path, tmp_path / "set") == 2
    assert convert(tmp_path / "nowhere", tmp_path / "set") == 2
    first, second, third = capsys.readouterr().err.splitlines()
    assert first.endswith("found 6 raw, 6 processed, 1 zarr")
    assert second.endswith("found an empty folder")
    assert third.endswith("files or a zipped Zarr store, found no such file or folder")
