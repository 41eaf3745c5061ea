"""The three formats of the original program: what it wrote of the same episodes must agree after import."""

import json
import math
import pickle
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from copolicy.collect.reward import reward
from copolicy.collect.world import TableWorld
from copolicy.convert.cli import main
from copolicy.convert.upstream_episode import UpstreamOptions
from copolicy.convert.upstream_map import check_by_path, check_by_rewards
from copolicy.convert.upstream_processed import read_processed
from copolicy.convert.upstream_raw import read_raw
from copolicy.convert.upstream_zarr import ZarrStore
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.task import MAP_SETS, MapConfig, Physics

OPTIONS = UpstreamOptions()
EPISODES = (1, 2, 3, 4, 8, 11)
CONFIG = MAP_SETS["training"][10]


@pytest.fixture(scope="session")
def examples(upstream) -> Path:
    return upstream / "examples_scripted"


@pytest.fixture(scope="session")
def zarr_places(examples) -> dict[int, int]:
    """Place in the store of each numbered episode."""
    index = json.loads((examples / "zarr_episode_index.json").read_text())
    return {int(entry["raw"].removeprefix("ep_")): entry["zarr_episode"] for entry in index}


def raw(examples: Path, number: int, options=OPTIONS):
    return read_raw(examples / "raw" / "trajectories" / f"ep_{number}.pkl", options)


def processed(examples: Path, number: int, options=OPTIONS):
    return read_processed(examples / "processed_npz" / f"ep_{number}" / f"ep_{number}.npz", options)


def held(steps: int) -> np.ndarray:
    """Random forces `(steps, 4)`, each held for a while."""
    return np.repeat(np.random.default_rng(0).uniform(-1, 1, (steps // 6 + 1, 4)), 6, axis=0)[:steps]


def play(actions: np.ndarray, physics: Physics = Physics()) -> tuple[np.ndarray, np.ndarray]:  # noqa: B008 - frozen
    """States `(T + 1, 6)` under actions, and the actions."""
    world = TableWorld(CONFIG, physics)
    states = [(*world.pose, *world.velocity)]
    for action in actions:
        world.step(action)
        states.append((*world.pose, *world.velocity))
    return np.array(states), actions


def write_raw(
    folder: Path, states, actions, config=CONFIG, name="ep_1", map_config: MapConfig | None = None, success=False
) -> Path:
    """The files that the original writes for one episode."""
    rows = [
        [*map(np.float64, state), action, np.float64(0), step == len(actions), success, step, 1 / 30]
        + [[np.float64(value) for value in config.goal], *(np.array(centre) for centre in config.obstacles)]
        + [np.zeros(2, int)] * 5 + [np.float64(0)]
        for step, (state, action) in enumerate(zip(states[1:], actions, strict=True), start=1)
    ]  # fmt: skip
    path = folder / "trajectories" / f"{name}.pkl"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(pickle.dumps(rows, 4))
    if map_config:
        (folder / "map_cfg").mkdir(exist_ok=True)
        x, y, angle = map_config.start
        np.savez(
            folder / "map_cfg" / f"{name}.npz",
            table=np.array({"x": x, "y": y, "angle": angle}, dtype=object),
            obstacles=np.array({"obstacles": np.array(map_config.obstacles)}, dtype=object),
            goal=np.array({"goal": np.array(map_config.goal)}, dtype=object),
        )
    return path


@pytest.mark.parametrize("number", EPISODES)
def test_raw_rows_are_moved_to_the_state_before_the_action(examples, number):
    episode = raw(examples, number)
    path = examples / "raw" / "trajectories" / f"ep_{number}.pkl"
    rows = pickle.loads(path.read_bytes())
    after = np.array([row[:6] for row in rows], float)
    assert np.array_equal(episode.states[1:, :2], after[:-1, :2])
    assert np.array_equal(episode.final_state[:2], after[-1, :2])
    assert np.array_equal(episode.states[1:, 4:], after[:-1, 3:])
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


def test_a_processed_file_with_another_map_is_noticed_and_set_right(examples):
    episode = processed(examples, 1)
    assert episode.meta.quality_flags == "map_mismatch,map_recovered"
    assert episode.meta.map_id == raw(examples, 1).meta.map_id
    assert episode.notes[1] == (
        "stored map is not the one played: its start is 120 px from the path's; goal (960.0, 420.0) and obstacles "
        "((720.0, 420.0),) recovered from the rewards; others far from the path may have stood there too"
    )
    assert [processed(examples, number).meta.quality_flags for number in EPISODES[1:]] == [""] * 5


@pytest.mark.parametrize("number", EPISODES)
def test_the_zarr_store_agrees_with_raw_files(examples, zarr_places, number):
    store = ZarrStore(examples / "table_10Hz.zarr")
    episode, expected = store.read(zarr_places[number], OPTIONS), raw(examples, number)
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


def test_a_zarr_episode_with_another_map_is_noticed(examples, zarr_places):
    episode = ZarrStore(examples / "table_10Hz.zarr").read(zarr_places[1], OPTIONS)
    played = raw(examples, 1).map_config
    assert episode.meta.quality_flags == "map_mismatch,goal_recovered"
    assert (episode.map_config.start, episode.map_config.goal) == (played.start, played.goal)
    assert episode.map_config.obstacles != played.obstacles
    assert episode.notes[1].endswith("its obstacles may be wrong")


def test_a_store_with_a_reward_column_reads_the_same(examples, tmp_path):
    shutil.copytree(examples / "table_10Hz.zarr", tmp_path / "store")
    before = ZarrStore(tmp_path / "store")
    metadata = json.loads((tmp_path / "store/data/obs/.zarray").read_text())
    metadata |= {"shape": [1933, 19], "chunks": [1933, 19], "compressor": None}
    (tmp_path / "store/data/obs/.zarray").write_text(json.dumps(metadata))
    (tmp_path / "store/data/obs/0.0").write_bytes(np.column_stack((before.obs, np.zeros(1933))).tobytes())
    after = ZarrStore(tmp_path / "store")
    assert repr(after.read(0, OPTIONS).meta) == repr(before.read(0, OPTIONS).meta)
    assert np.array_equal(after.read(0, OPTIONS).states, before.read(0, OPTIONS).states)


@pytest.mark.parametrize("name", ["pi/2", "pi/8"])
def test_the_angular_limit_is_found_in_every_format(tmp_path, name):
    physics = Physics(angular_acceleration_limit={"pi/2": math.pi / 2, "pi/8": math.pi / 8}[name])
    states, actions = play(held(90), physics)
    path = write_raw(tmp_path, states, actions)
    episode = read_raw(path, OPTIONS)
    assert episode.notes[0].endswith(f"angular limit {name}")
    assert "dynamics_mismatch" not in episode.meta.quality_flags
    assert np.abs(episode.states[0, :2] - CONFIG.start[:2]).max() < 1e-9
    other = read_raw(path, UpstreamOptions("pi/8" if name == "pi/2" else "pi/2"))
    assert other.meta.quality_flags == "dynamics_mismatch"

    cosine, sine = np.cos(states[1:, 2:3]), np.sin(states[1:, 2:3])
    pose = np.hstack((states[1:, :2], cosine, sine))
    conditions = np.tile([*CONFIG.start, *CONFIG.goal, 1, 1, 1], (90, 1))
    write_processed(tmp_path / "p" / "p.npz", pose, actions, conditions)
    single = read_processed(tmp_path / "p" / "p.npz", OPTIONS)
    assert single.notes[0].endswith(f"angular limit {name}")
    assert np.abs(single.states - episode.states).max() < 1e-4

    write_store(tmp_path / "store", states, actions)
    tenth = ZarrStore(tmp_path / "store").read(0, OPTIONS)
    assert tenth.notes[0].endswith(f"angular limit {name}")
    assert tenth.meta.quality_flags == ""
    assert np.abs(tenth.states - episode.states[::3]).max() < 1e-9


def write_store(folder: Path, states, actions):
    """The 10 Hz store of one episode, in double precision and without compression."""
    kept = np.arange(0, len(actions), 3)
    pose = np.column_stack((states[:, :2], np.cos(states[:, 2]), np.sin(states[:, 2]), states[:, 3:]))
    obstacles = np.array([*CONFIG.obstacles, (0, 0), (0, 0), (0, 0)])[:3].ravel()
    setting = np.tile([*CONFIG.start, *CONFIG.goal, *obstacles], (len(kept), 1))
    past = np.vstack((np.zeros(4), actions[kept[1:] - 1]))
    arrays = {
        "data/obs": np.hstack((pose[kept + 1], setting)),
        "data/action": actions[kept],
        "data/past_action": past,
        "meta/episode_ends": np.array([len(kept)]),
    }
    for name, array in arrays.items():
        (folder / name).mkdir(parents=True)
        metadata = {"zarr_format": 2, "shape": array.shape, "chunks": array.shape, "dtype": array.dtype.str}
        metadata |= {"compressor": None, "fill_value": 0, "filters": None, "order": "C"}
        (folder / name / ".zarray").write_text(json.dumps(metadata))
        (folder / name / ".".join("0" * array.ndim)).write_bytes(array.tobytes())


def write_processed(path: Path, pose, actions, conditions):
    rewards = np.zeros((len(pose), 1))
    path.parent.mkdir()
    fields = {
        "states": np.hstack((pose, conditions[:, 3:5], conditions[:, 3:5])),
        "actions": actions,
        "rewards": rewards,
        "conditioning_var": conditions,
        "table_init": conditions[0, :2],
        "table_goal": conditions[0, 3:5],
        "obstacles": np.array(CONFIG.obstacles),
    }
    members: dict[str, Any] = {name: np.asarray(value, np.float32) for name, value in fields.items()}
    np.savez(path, **members, map_file="map.npz")


def test_rewards_that_no_known_map_gives_are_said(tmp_path):
    states, actions = play(held(60))
    pose = np.hstack((states[1:, :2], np.cos(states[1:, 2:3]), np.sin(states[1:, 2:3])))
    write_processed(tmp_path / "p" / "p.npz", pose, actions, np.tile([*CONFIG.start, *CONFIG.goal, 1, 1, 1], (60, 1)))
    episode = read_processed(tmp_path / "p" / "p.npz", OPTIONS)
    assert episode.meta.quality_flags == "map_mismatch"
    assert "no known map gives the rewards, goal and obstacles kept" in episode.notes[1]
    assert episode.map_config == CONFIG


def test_rewards_tell_a_wrong_goal_where_the_start_is_right():
    states, _ = play(np.tile((0.3, 0.1, 0.3, 0.1), (300, 1)))
    rewards = np.array([reward(x, y, CONFIG) for x, y in states[1:, :2]])
    assert check_by_rewards(CONFIG, states[0], states[1:, :2], rewards).flags == ()
    stored = replace(CONFIG, goal=(960.0, 180.0), obstacles=((600.0, 300.0),))
    finding = check_by_rewards(stored, states[0], states[1:, :2], rewards)
    assert finding.flags == ("map_mismatch", "map_recovered")
    assert "its rewards are up to" in finding.notes[0]
    assert finding.config.goal == CONFIG.goal
    assert set(finding.config.obstacles) <= set(CONFIG.obstacles)


def test_a_path_tells_a_wrong_map_where_the_start_is_right(examples, zarr_places):
    episode = ZarrStore(examples / "table_10Hz.zarr").read(zarr_places[3], OPTIONS)
    played, last = episode.map_config, episode.actions[-1]

    def check(stored: MapConfig):
        return check_by_path(stored, episode.states, episode.final_state, last, Physics())

    assert check(played).flags == ()
    elsewhere = check(replace(played, goal=(960.0, 420.0)))
    assert elsewhere.flags == ("map_mismatch", "goal_recovered")
    assert elsewhere.config == played
    assert "the path ends where nothing of it is touched; goal (960.0, 180.0) recovered" in elsewhere.notes[0]
    # A table that ends between two goals touches both.
    between = ZarrStore(examples / "table_10Hz.zarr").read(zarr_places[4], OPTIONS)
    stored = replace(between.map_config, goal=(960.0, 420.0))
    finding = check_by_path(stored, between.states, between.final_state, between.actions[-1], Physics())
    assert finding.flags == ("map_mismatch",)
    assert finding.notes[0].endswith("its goal and obstacles may be wrong")
    x, y = (round(float(value)) for value in episode.states[100, :2])
    crossed = check(replace(played, obstacles=((x, y),)))
    assert crossed.flags == ("map_mismatch",)
    assert "the path runs through its goal or obstacles in" in crossed.notes[0]


def test_rows_that_were_skipped_are_refused(tmp_path):
    states, actions = play(held(60))
    pose = np.hstack((states[1:, :2], np.cos(states[1:, 2:3]), np.sin(states[1:, 2:3])))
    conditions = np.tile([*CONFIG.start, *CONFIG.goal, 1, 1, 1], (60, 1))
    write_processed(tmp_path / "p" / "p.npz", pose[::3], actions[::3], conditions[::3])
    with pytest.raises(
        FileFormatError, match=r"p.npz: expected consecutive steps of 1/30 s that follow from the actions"
    ):
        read_processed(tmp_path / "p" / "p.npz", OPTIONS)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"goal": (960.0, 180.0)}, "its goal is (960.0, 180.0)"),
        ({"obstacles": ((720.0, 420.0),)}, "its obstacles are ((720.0, 420.0),)"),
        ({"start": (240.0, 240.0, 3.14)}, "its start is 120 px from the path's"),
    ],
)
def test_raw_rows_win_over_a_map_file(tmp_path, changes, says):
    states, actions = play(held(40))
    stored = MapConfig(**{"start": CONFIG.start, "goal": CONFIG.goal, "obstacles": CONFIG.obstacles, **changes})
    episode = read_raw(write_raw(tmp_path, states, actions, map_config=stored), OPTIONS)
    assert episode.meta.quality_flags == "map_mismatch"
    assert says in episode.notes[1]
    assert episode.map_config == CONFIG
    assert np.abs(episode.states[:, :2] - states[:-1, :2]).max() < 1e-9


def test_map_files_are_matched_by_their_whole_name(tmp_path):
    states, actions = play(held(20))
    write_raw(tmp_path, states, actions, name="ep_11", map_config=MAP_SETS["training"][50])
    episode = read_raw(write_raw(tmp_path, states, actions, name="ep_1"), OPTIONS)
    assert episode.notes[1:] == ("no map file of this name: start found by undoing the first step",)
    assert episode.map_config == CONFIG


def test_forces_beyond_the_bound_act_as_the_bound_did(tmp_path):
    episode = read_raw(write_raw(tmp_path, *play(3 * held(30))), OPTIONS)
    assert np.abs(episode.actions).max() == 1
    assert episode.meta.replay_drift_px < 1e-9
    assert "dynamics_mismatch" not in episode.meta.quality_flags


def test_a_success_flag_that_the_contact_test_denies_is_flagged(tmp_path):
    states, actions = play(held(30))
    episode = read_raw(write_raw(tmp_path, states, actions, success=True), OPTIONS)
    assert (episode.meta.success, episode.meta.termination_reason) == (False, "unknown")
    assert episode.meta.quality_flags == "outcome_differs"
    assert episode.notes[-1] == "the file says success=True, the contact test False"


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
    path = write_raw(tmp_path, *play(held(20)))
    path.write_bytes(pickle.dumps(edit(pickle.loads(path.read_bytes())), 4))
    with pytest.raises(FileFormatError) as error:
        read_raw(path, OPTIONS)
    assert str(error.value).startswith(str(path))
    assert found in str(error.value)


def load(root: Path) -> Any:
    return LeRobotDataset("me/table", root=root)


def convert(path: Path, root: Path, *flags: str) -> int:
    return main(["upstream", str(path), "--root", str(root), "--repo-id", "me/table", *flags])


@pytest.mark.parametrize(
    ("name", "form", "episodes", "frames", "flags"),
    [
        ("raw", "raw", 6, 974, {}),
        ("processed_npz", "processed", 6, 974, {"map_mismatch": 1, "map_recovered": 1}),
        ("table_10Hz.zarr", "zarr", 11, 1933, {"map_mismatch": 1, "goal_recovered": 1}),
    ],
)
def test_each_format_becomes_a_data_set(examples, tmp_path, capsys, name, form, episodes, frames, flags):
    assert convert(examples / name, tmp_path / "set", "--json", "--license", "CC-BY-4.0") == 0
    captured = capsys.readouterr()
    summary = json.loads(captured.out)
    assert captured.err == ""
    assert (summary["format"], summary["episodes"], summary["frames"]) == (form, episodes, frames)
    assert summary["hold"] == ("first" if form == "zarr" else "mean")
    assert summary["successes"] == episodes - 1
    assert summary["quality_flags"] == flags
    assert len(summary["noticed"]) == bool(flags)
    dataset = load(tmp_path / "set")
    assert dataset.num_frames == frames
    rows = dataset.meta.episodes
    assert set(rows["source"]) == {"upstream"}
    assert set(rows["license"]) == {"CC-BY-4.0"}
    assert len(set(rows["episode_uuid"])) == episodes
    successes = [bool(dataset[end - 1]["next.success"]) for end in rows["dataset_to_index"]]
    assert successes == rows["success"]
    notes = json.loads((tmp_path / "set/meta/copolicy.json").read_text())["notes"]
    assert set(notes) == set(rows["episode_uuid"])


def test_files_come_in_the_order_of_their_numbers(examples, tmp_path):
    assert convert(examples / "raw", tmp_path / "set", "--fps", "30") == 0
    lengths = load(tmp_path / "set").meta.episodes["length"]
    assert lengths == [478, 542, 660, 636, 478, 123]  # 1, 2, 3, 4, 8, 11


def test_a_store_has_one_rate_and_one_hold(examples, tmp_path, capsys):
    store = examples / "table_10Hz.zarr"
    assert convert(store, tmp_path / "set", "--fps", "30") == 2
    assert convert(store, tmp_path / "set", "--hold", "mean") == 2
    assert capsys.readouterr().err.splitlines() == [
        "copolicy-convert: fps: expected 10: the store holds every third step only, found 30",
        "copolicy-convert: hold: expected 'first': the store holds the first of three actions only, found 'mean'",
    ]
    assert list(tmp_path.iterdir()) == []


def test_damaged_files_stop_the_conversion_or_are_left_out(examples, tmp_path, capsys):
    shutil.copytree(examples / "raw", tmp_path / "raw")
    path = tmp_path / "raw" / "trajectories" / "ep_3.pkl"
    path.write_bytes(path.read_bytes()[:5000])
    assert convert(tmp_path / "raw", tmp_path / "set") == 1
    assert capsys.readouterr().err == (
        f"copolicy-convert: {path}: expected a pickle of NumPy arrays and plain values, found pickle data was "
        "truncated; nothing was written (--skip-damaged leaves such files out)\n"
    )
    assert not (tmp_path / "set").exists()
    assert convert(tmp_path / "raw", tmp_path / "set", "--skip-damaged", "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["episodes"] == 5
    assert len(summary["damaged_left_out"]) == 1
    record = json.loads((tmp_path / "set/meta/copolicy.json").read_text())
    assert record["left_out"]["damaged"] == ["trajectories/ep_3.pkl"]


def test_a_folder_must_hold_one_format(examples, tmp_path, capsys):
    assert convert(examples, tmp_path / "set") == 2
    assert convert(tmp_path, tmp_path / "set") == 2
    assert convert(tmp_path / "nowhere", tmp_path / "set") == 2
    first, second, third = capsys.readouterr().err.splitlines()
    assert first.endswith("found 6 raw, 6 processed, 1 zarr")
    assert second.endswith("found none of them")
    assert third.endswith("nowhere: expected a folder of the original program's files, found no folder")
