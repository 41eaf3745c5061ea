"""Simulated recordings: reproducible, balanced, marked as simulated."""

import json
import os
import pickle
import re
import signal
import subprocess
import sys
import time
from collections import Counter

import numpy as np
import pytest

from copolicy.collect.cli import main
from copolicy.collect.recording.wall_clock import WallClockAnchor
from copolicy.collect.rollout import Agent
from copolicy.collect.simulate.command import simulate
from copolicy.collect.simulate.episode_job import record_episode
from copolicy.collect.simulate.recipes import RECIPES, Recipe
from copolicy.collect.simulate.schedule import balanced_schedule
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.exceptions import InvalidValueError, OutputExistsError, UnknownNameError
from copolicy.dataset.recording.reader import read_episode
from copolicy.dataset.task import RUNNING
from copolicy.tasks.table.agents import PAIRS
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import MAP_SETS, identify
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.start_pose import displaced_start
from copolicy.tasks.table.world import TableWorld

STARTED_NS = 1_700_000_000_000_000_000
SHORT = Physics(step_limit=60)


class StraightLine(Agent):
    """Pushes towards a goal, harder than allowed, so that the recorded force is the clipped one."""

    def __init__(self, goal):
        self.goal = np.array(goal)

    def act(self, states, worlds):
        way = self.goal - states[:, :2]
        return 3.0 * way / np.linalg.norm(way)


def run(path, config, physics=None):
    agents = (StraightLine(config.goal), StraightLine(config.goal))
    return record_episode(
        path, config, agents, EpisodeMeta("u"), WallClockAnchor.simulated(STARTED_NS), physics or Physics()
    )


@pytest.mark.parametrize(
    ("obstacles", "physics", "reason"),
    [
        ((), Physics(), "goal"),
        (((400.0, 300.0),), Physics(), "collision_obstacle"),
        ((), SHORT, "timeout"),
    ],
)
def test_every_outcome_is_recorded(tmp_path, obstacles, physics, reason):
    config = MapConfig((240.0, 300.0, 3.14), (700.0, 300.0), obstacles)
    result = run(tmp_path / "one.mcap", config, physics)
    episode = read_episode(tmp_path / "one.mcap")
    assert result.termination_reason == episode.meta.termination_reason == reason
    assert result.success == episode.meta.success == (reason == "goal")
    assert result.steps == len(episode.actions)
    assert np.abs(episode.actions).max() == 1.0

    # What is recorded is what the world does: from each state, the action leads to the next.
    world = TableWorld(config, physics)
    outcome = RUNNING
    for state, action in zip(episode.states, episode.actions, strict=True):
        assert (world.observation == state).all()
        assert not outcome.done
        outcome = world.step(action)
    assert (world.observation == episode.final_state).all()
    assert outcome.reason == reason


def numbers(folder):
    return {
        path.name: (episode.states.tobytes(), episode.actions.tobytes(), episode.meta.episode_uuid)
        for path in sorted(folder.glob("*.mcap"))
        for episode in [read_episode(path)]
    }


def test_equal_seeds_give_equal_bytes_for_one_and_two_workers(tmp_path):
    one = simulate(tmp_path / "one", 4, 5, workers=1, settings=SHORT, started_ns=STARTED_NS)
    two = simulate(tmp_path / "two", 4, 5, workers=2, settings=SHORT, started_ns=STARTED_NS)
    later = simulate(tmp_path / "later", 3, 5, workers=1, settings=SHORT)
    assert sorted(path.name for path in (tmp_path / "two").iterdir()) == [f"episode_{i:06d}.mcap" for i in range(4)]
    for path in (tmp_path / "one").iterdir():
        assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes()
    # At another time and for another number of episodes: other bytes, the same episodes.
    assert numbers(tmp_path / "later").items() <= numbers(tmp_path / "one").items()
    assert one["steps"] == two["steps"] > later["steps"]


def test_other_seeds_give_other_episodes(tmp_path):
    simulate(tmp_path / "one", 2, 5, workers=1, settings=SHORT)
    simulate(tmp_path / "two", 2, 6, workers=1, settings=SHORT)
    assert not set(numbers(tmp_path / "one").values()) & set(numbers(tmp_path / "two").values())


def test_metadata_of_simulated_episodes(tmp_path):
    pair = sorted(PAIRS)[0]
    summary = simulate(tmp_path, 3, 1, "unseen", workers=1, orientations=True, pairs=[pair], settings=SHORT)
    assert (summary["episodes"], summary["success_rate"]) == (3, 0.0)
    assert summary["termination_reasons"] == {"timeout": 3}
    assert summary["bytes"] == sum(path.stat().st_size for path in tmp_path.iterdir())
    episodes = [read_episode(path) for path in sorted(tmp_path.iterdir())]
    starts = {(x, y, theta) for config in MAP_SETS["unseen"] for x, y, _ in [config.start] for theta in
              (0.0, np.pi / 2, np.pi, 3 * np.pi / 2)}  # fmt: skip
    for episode in episodes:
        meta = episode.meta
        assert (meta.source, meta.pair_id, meta.player_0_id, meta.player_1_id) == (
            "simulated", pair, f"{pair}-robot", f"{pair}-human",
        )  # fmt: skip
        assert (meta.controller_0, meta.controller_1, meta.license, meta.consent_id) == ("scripted", "scripted", "", "")
        assert (meta.map_id, meta.map_set) == identify(episode.map_config)
        assert meta.session_id == "simulated-unseen-orientations-1"
        assert episode.map_config.start in starts
        assert np.isnan(meta.achieved_hz)
        assert meta.duration_s == 2.0
    assert len({episode.meta.seed for episode in episodes}) == 3
    assert len({episode.meta.episode_uuid for episode in episodes}) == 3


@pytest.mark.parametrize("name", ["episode_000007.mcap", "anything.mcap.part"])
def test_a_folder_with_recordings_is_refused_before_anything_is_written(tmp_path, name):
    (tmp_path / name).write_bytes(b"precious")
    with pytest.raises(OutputExistsError, match=re.escape(f"{tmp_path / name}: expected a path that does not exist")):
        simulate(tmp_path, 2, 0, workers=1)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_file_in_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "out").write_bytes(b"precious")
    with pytest.raises(OutputExistsError):
        simulate(tmp_path / "out", 2, 0, workers=1)


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        ({"episodes": 0}, InvalidValueError, "episodes: expected at least 1, found 0"),
        ({"workers": 0}, InvalidValueError, "workers: expected at least 1, found 0"),
        ({"seed": -1}, InvalidValueError, "seed: expected at least 0, found -1"),
        ({"map_set": "moon"}, UnknownNameError, "unknown map set 'moon'; available: holdout, paper36, paper36-orders"),
        ({"pairs": ["S99"]}, UnknownNameError, "unknown pair 'S99'; available: "),
    ],
)
def test_wrong_calls_say_what_is_wrong_and_write_nothing(tmp_path, arguments, error, text):
    out = tmp_path / "out"
    with pytest.raises(error, match=re.escape(text)):
        simulate(out, **{"episodes": 1, "seed": 0, **arguments})
    assert not out.exists()


@pytest.mark.parametrize(
    "error", [OutputExistsError("a.mcap"), UnknownNameError("pair", "S99", PAIRS), InvalidValueError("a", "b", 3)]
)
def test_errors_can_be_pickled(error):
    arrived = pickle.loads(pickle.dumps(error))
    assert (type(arrived), str(arrived), arrived.exit_status) == (type(error), str(error), 2)


@pytest.mark.parametrize("pairs", [1, 3, 8])
@pytest.mark.parametrize("episodes", [1, 50, 84, 200])
def test_schedule_is_balanced(pairs, episodes):
    names = tuple(f"P{pair}" for pair in range(pairs))
    schedule = balanced_schedule(84, names, episodes, 0)
    assert len(schedule) == episodes
    assert schedule == balanced_schedule(84, names, 84 * pairs + 200, 0)[:episodes]
    maps = Counter(place for place, _ in schedule)
    assert max(maps.values()) - min(maps.get(place, 0) for place in range(84)) <= 1
    for visit in range(0, episodes, 84):
        shares = Counter(pair for _, pair in schedule[visit : visit + 84])
        assert max(shares.values()) - min(shares.get(pair, 0) for pair in names) <= 1


def test_schedule_brings_every_pair_to_every_map_and_is_shuffled():
    schedule = balanced_schedule(7, ("A", "B", "C"), 21, 0)
    assert set(Counter(schedule).values()) == {1}
    assert len(set(schedule)) == 21
    assert schedule != balanced_schedule(7, ("A", "B", "C"), 21, 1)
    with pytest.raises(InvalidValueError, match="at least one map and one pair"):
        balanced_schedule(3, (), 1, 0)


def test_command_simulates_and_reports(tmp_path, capsys):
    out = tmp_path / "made" / "here"
    command = ["simulate", "--episodes", "1", "--seed", "4", "--maps", "holdout", "--out", str(out), "--workers", "1"]
    assert main([*command, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["episodes"] == 1
    episode = read_episode(out / "episode_000000.mcap")
    assert episode.meta.map_set in ("training", "holdout")
    assert main(command) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == (
        f"copolicy-collect: {out / 'episode_000000.mcap'}: expected a path that does not exist yet, found one; "
        "nothing was overwritten\n"
    )


def test_recipes_do_not_change():
    """A name stands for its episodes: who trained on `pairs-sim-376` must be able to make it again."""
    assert {
        "pairs-sim-376": Recipe(376, 0, "paper36", False, 0.0, None),
        "pairs-sim-376-orders": Recipe(376, 0, "paper36-orders", False, 0.0, None),
        "pairs-sim-376-orientations": Recipe(376, 0, "paper36", True, 0.0, None),
        "pairs-sim-376-wide": Recipe(376, 0, "paper36", False, 1.0, 2.6),
        "pairs-sim-3000": Recipe(3000, 1, "varied", True, 1.0, None),
    } == RECIPES


def test_a_recipe_gives_the_episodes_of_its_flags(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(RECIPES, "two", Recipe(2, 3, "unseen", orientations=True, start_noise=0.5, clearance=2.6))
    named = ["simulate", "--recipe", "two", "--out", str(tmp_path / "named"), "--workers", "1", "--json"]
    assert main(named) == 0
    flags = ["--episodes", "2", "--seed", "3", "--maps", "unseen", "--orientations", "--start-noise", "0.5"]
    spelt = ["simulate", *flags, "--clearance", "2.6", "--out", str(tmp_path / "spelt"), "--workers", "1"]
    assert main(spelt) == 0
    assert json.loads(capsys.readouterr().out.split("\n}")[0] + "}")["episodes"] == 2
    assert numbers(tmp_path / "named") == numbers(tmp_path / "spelt")
    without = ["simulate", *flags, "--out", str(tmp_path / "without"), "--workers", "1"]
    assert main(without) == 0
    assert not set(numbers(tmp_path / "named").values()) & set(numbers(tmp_path / "without").values())


@pytest.mark.parametrize(
    ("flags", "text"),
    [
        (["--recipe", "pairs-sim-376", "--episodes", "5"], "argument --episodes: not allowed with argument --recipe"),
        (["--episodes", "5", "--recipe", "pairs-sim-376"], "argument --recipe: not allowed with argument --episodes"),
        ([], "one of the arguments --episodes --recipe is required"),
    ],
)
def test_either_a_recipe_or_a_number_of_episodes(tmp_path, capsys, flags, text):
    with pytest.raises(SystemExit) as stopped:
        main(["simulate", "--out", str(tmp_path / "out"), *flags])
    assert stopped.value.code == 2
    assert capsys.readouterr().err.endswith(f"copolicy-collect simulate: error: {text}\n")
    assert not (tmp_path / "out").exists()


def test_an_unknown_recipe_lists_the_known_ones(tmp_path, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["simulate", "--out", str(tmp_path / "out"), "--recipe", "pairs-sim-375"])
    assert stopped.value.code == 2
    error = capsys.readouterr().err
    assert "argument --recipe: invalid choice: 'pairs-sim-375' (choose from " in error
    assert all(name in error for name in RECIPES)


@pytest.mark.parametrize(
    ("flag", "found"),
    [
        (["--seed", "0"], "0"), (["--maps", "holdout"], "'holdout'"), (["--orientations"], "True"),
        (["--start-noise", "1"], "1.0"), (["--clearance", "2"], "2.0"),
    ],
)  # fmt: skip
def test_flags_that_a_recipe_decides_are_refused(tmp_path, capsys, flag, found):
    assert main(["simulate", "--out", str(tmp_path / "out"), "--recipe", "pairs-sim-376", *flag]) == 2
    assert capsys.readouterr().err == (
        f"copolicy-collect: {flag[0]}: expected nothing beside --recipe pairs-sim-376, which decides it, "
        f"found {found}\n"
    )
    assert not (tmp_path / "out").exists()


def test_ctrl_c_leaves_whole_episodes_and_one_line(tmp_path):
    command = [sys.executable, "-m", "copolicy.collect.cli", "simulate", "--episodes", "500", "--workers", "2"]
    process = subprocess.Popen(
        [*command, "--out", str(tmp_path)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    with process:
        while len(list(tmp_path.glob("*.mcap"))) < 10:  # both workers are past their imports
            assert process.poll() is None
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    assert (process.returncode, output, errors) == (130, "", "copolicy-collect: stopped\n")
    assert not list(tmp_path.glob("*.part"))
    assert not any(read_episode(path).meta.discarded for path in tmp_path.glob("*.mcap"))


def test_every_command_has_help_with_an_example(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    commands = re.findall(r"^    (\w+) ", capsys.readouterr().out, re.MULTILINE)
    assert "simulate" in commands
    for command in commands:
        with pytest.raises(SystemExit):
            main([command, "--help"])
        assert f"example:\n  copolicy-collect {command} " in capsys.readouterr().out


def test_start_noise_moves_the_starts_and_says_so(tmp_path):
    simulate(tmp_path, 6, seed=3, workers=1, start_noise=1.0)
    starts = set()
    for path in sorted(tmp_path.glob("*.mcap")):
        episode = read_episode(path)
        x, y, theta = episode.map_config.start
        starts.add((x, y, theta))
        assert episode.states[0, :2].tolist() == [x, y]
        assert episode.meta.map_id.endswith("-displaced")
        nominal = MAP_SETS["training"][int(episode.meta.map_id.split("-")[1])]
        assert abs(x - nominal.start[0]) <= 90
        assert abs(y - nominal.start[1]) <= 60
        assert abs(theta - nominal.start[2]) <= 0.6
        assert (episode.map_config.goal, episode.map_config.obstacles) == (nominal.goal, nominal.obstacles)
    assert len(starts) == 6


def test_a_displaced_start_has_no_contact_and_is_unchanged_for_a_large_scale():
    config = MAP_SETS["training"][6]
    rng = np.random.default_rng(0)
    for _ in range(50):
        displaced = displaced_start(config, 2.0, rng)
        assert not any(TableWorld(displaced).contact(displaced.start))
    assert displaced_start(config, 1e6, rng) == config


def test_clearance_widens_the_path(tmp_path):
    nearest = {}
    for clearance in (1.0, 3.0):
        out = tmp_path / str(clearance)
        simulate(out, 8, seed=1, workers=1, clearance=clearance)
        episodes = [read_episode(path) for path in sorted(out.glob("*.mcap"))]
        nearest[clearance] = np.mean(
            [min(np.hypot(*(e.path - o).T).min() for o in e.map_config.obstacles) for e in episodes]
        )
    assert nearest[3.0] > nearest[1.0] + 5.0


def test_paper36_orders_has_every_order_of_the_obstacles_equally_often():
    orders, listed = MAP_SETS["paper36-orders"], MAP_SETS["paper36"]
    configurations = Counter((config.start, config.goal, len(config.obstacles)) for config in orders)
    assert set(configurations.values()) == {6}
    assert configurations.keys() == {(config.start, config.goal, len(config.obstacles)) for config in listed}
    lists = Counter(config.obstacles for config in orders)  # 12 starts and goals
    one, two, three = ((480, 300),), ((720, 180), (480, 300)), ((720, 420), (720, 180), (480, 300))
    assert (lists[one], lists[two], lists[three]) == (24, 12, 12)
    assert len(lists) == 3 + 6 + 6
    # The order changes neither a map's name nor the share of a layout: 216 entries for 108.
    names = Counter(map(identify, listed))
    assert Counter(map(identify, orders)) == {name: 2 * count for name, count in names.items()}
