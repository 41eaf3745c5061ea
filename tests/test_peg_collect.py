"""A second task, from another package, through everything that collects: simulated, played, replayed, drawn."""

import json
from dataclasses import replace

import numpy as np
import pytest
from play_session import SimulatedClock, settings

from copolicy.collect.agents import ConstantAgent, PersonAgent, PolicyAgent, ReplayAgent
from copolicy.collect.cli import main
from copolicy.collect.episodes import run_episodes
from copolicy.collect.inputs import HALVES, InputSample
from copolicy.collect.play.finished import Finished
from copolicy.collect.play.lobby import Lobby
from copolicy.collect.play.result import ResultPhase
from copolicy.collect.play.session_run import prepared
from copolicy.collect.play.settings import PlayerSpec, PlaySettings
from copolicy.collect.recording.recover import recover
from copolicy.collect.replay.sheet import draw_sheet
from copolicy.collect.replay.track import frame_positions, read_track
from copolicy.collect.replay.verify import verify
from copolicy.collect.rollout import Rollout
from copolicy.collect.screen import Canvas, palette
from copolicy.collect.screen.outline_view import OutlineView, scene_view
from copolicy.collect.sdl import pygame
from copolicy.collect.session import BalancedSchedule, iter_recordings
from copolicy.collect.ticker import LoopStatistics, Tick, Ticker
from copolicy.dataset.exceptions import CopolicyError, InvalidValueError
from copolicy.dataset.recording.reader import read_episode
from copolicy.dataset.task_spec import Vector

SIMULATE = ("simulate", "--task", "peg", "--maps", "right", "--seed", "1", "--workers", "1")


@pytest.fixture
def simulated(peg, tmp_path):
    """Four recordings of simulated pairs."""
    folder = tmp_path / "simulated"
    assert main([*SIMULATE, "--episodes", "4", "--out", str(folder)]) == 0
    return sorted(folder.glob("*.mcap"))


def test_simulated_pairs_are_recorded_at_the_rate_of_the_task(peg, simulated, tmp_path):
    episodes = [read_episode(path) for path in simulated]
    assert [one.task for one in episodes] == ["peg"] * 4
    assert all(one.meta.success and one.fps == 20 for one in episodes)
    assert {one.meta.pair_id for one in episodes} == {"even", "lazy"}
    first = episodes[0]
    assert first.meta.duration_s == pytest.approx(len(first.actions) / 20)
    assert first.meta.session_id == "simulated-peg-right-1"
    again = tmp_path / "again"
    assert main([*SIMULATE, "--episodes", "4", "--out", str(again)]) == 0
    for path, one in zip(sorted(again.glob("*.mcap")), episodes, strict=True):
        np.testing.assert_array_equal(read_episode(path).actions, one.actions)


@pytest.mark.parametrize(
    ("flags", "line"),
    [
        (("--start-noise", "1"), "--start-noise: expected no such flag, found \"left out: the task 'peg' has no"),
        (("--clearance", "2"), "--clearance: expected no such flag, found \"left out: the task 'peg' has no"),
        (("--orientations",), "--orientations: expected no such flag, found \"left out: the task 'peg' has no"),
        (("--maps", "training"), "unknown map set 'training'; available: left, right"),
        (("--task", "pegs"), "unknown task 'pegs'; available: peg, table"),
    ],
)
def test_what_the_task_lacks_is_refused_before_anything_is_written(peg, tmp_path, capsys, flags, line):
    out = tmp_path / "out"
    assert main(["simulate", "--task", "peg", "--episodes", "1", "--out", str(out), *flags]) == 2
    assert line in capsys.readouterr().err
    assert not out.exists()


def test_a_recipe_is_of_the_table(peg, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["simulate", "--task", "peg", "--recipe", "pairs-sim-376", "--out", str(out)]) == 2
    assert "--task: expected nothing beside --recipe pairs-sim-376" in capsys.readouterr().err


def test_a_task_without_simulated_players_says_so(peg, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(type(peg), "agents", None)
    assert main([*SIMULATE, "--episodes", "1", "--out", str(tmp_path / "out")]) == 2
    assert "left out: the task 'peg' has no agents" in capsys.readouterr().err
    with pytest.raises(CopolicyError, match="has no agents"):
        PlayerSpec.parse("scripted", "peg")


def test_the_actions_of_a_recording_are_simulated_again(simulated, capsys):
    assert main(["replay", str(simulated[0]), "--verify", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["verify"]
    assert (told["reproduced"], told["max_drift_position"], told["max_drift_velocity"]) == (True, 0.0, 0.0)
    assert (told["limit_position"], told["settings"]) == (pytest.approx(2e-5), "default")
    assert "angular_limit" not in told
    assert told["recorded_end"] == told["simulated_end"] == f"mark after {told['steps']} steps"


@pytest.mark.parametrize(("shift", "reproduced"), [(1e-6, True), (1e-3, False)])
def test_a_state_that_the_actions_do_not_lead_to_is_found(simulated, shift, reproduced):
    track = read_track(simulated[0])
    states = track.episode.states.copy()
    states[10, 0] += shift
    told = verify(replace(track, episode=replace(track.episode, states=states)))
    assert (told["reproduced"], told["first_step_beyond"]) == (reproduced, None if reproduced else 10)
    assert told["max_drift_position"] == pytest.approx(shift)


@pytest.mark.parametrize(
    ("flags", "line"),
    [
        (("--max-drift-px", "1"), "--max-drift-px: expected none: drift is measured as position, velocity"),
        (("--angular-limit", "pi/8"), "--angular-limit: expected no such flag"),
    ],
)
def test_limits_of_the_table_are_refused(simulated, capsys, flags, line):
    assert main(["replay", str(simulated[0]), "--verify", *flags]) == 2
    assert line in capsys.readouterr().err


def test_films_and_sheets_are_made_from_the_outline(simulated, tmp_path, capsys):
    out = {kind: tmp_path / f"film.{kind}" for kind in ("gif", "mp4", "png")}
    call = ["replay", str(simulated[0]), "--json", "--width", "320", "--out", *map(str, out.values())]
    assert main(call) == 0
    told = json.loads(capsys.readouterr().out)
    track = read_track(simulated[0])
    assert track.seconds == track.steps / 20
    # A film of 12 pictures a second of an episode at 20 steps a second, and a second of its end.
    assert told["gif"]["frames"] == len(frame_positions(track, 12, 1.0)) + 12
    assert told["gif"]["seconds"] == pytest.approx(track.seconds + 1, abs=0.2)
    assert all(path.stat().st_size > 1000 for path in out.values())


def test_the_sheet_says_why_there_is_no_graph(simulated, monkeypatch):
    from copolicy.collect.replay import graph

    written = []
    monkeypatch.setattr(graph, "draw_text", lambda surface, text, *rest: written.append(text))
    sheet, steps = draw_sheet(read_track(simulated[0]), 3, 600)
    assert written == ["left out: the task 'peg' has no interaction measure"]
    assert len(steps) == 3
    colours = {tuple(colour) for colour in pygame.surfarray.array3d(sheet).reshape(-1, 3).tolist()}
    assert {palette.WOOD, palette.FLOOR} <= colours


@pytest.mark.parametrize("size", [(1200, 600), (400, 300), (300, 900)])
def test_an_outline_is_drawn_where_its_task_says(peg, size):
    scenario = peg.scenario_sets["right"][2]
    view = scene_view(peg, scenario)
    assert isinstance(view, OutlineView)
    surface = pygame.Surface(size, depth=32)
    rect = view.draw(surface, surface.get_rect(), (0.7, 0.2, 0.0), (1.0, 0.0, -1.0, 0.0), [(0.5, 0.2, 0.0)] * 3)
    assert rect.center == surface.get_rect().center
    assert rect.width / rect.height == pytest.approx(5, rel=0.03)

    def colour(x, y):
        at = view.to_screen((x, y))
        return tuple(surface.get_at((round(at[0]), round(at[1]))))[:3]

    assert colour(0.7, 0.2 + 0.015) == palette.WOOD
    assert colour(1.8, 0.3) == palette.FLOOR
    goal = palette.mix(palette.GREEN, palette.FLOOR, 0.45)
    assert max(abs(a - b) for a, b in zip(colour(1.6, 0.2), goal, strict=True)) < 12
    assert colour(0.6, 0.2) != palette.FLOOR, "an arrow or a trail to the left"


def test_a_task_without_an_outline_is_verified_and_not_drawn(peg, simulated, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(type(peg), "outline", None)
    assert main(["replay", str(simulated[0]), "--verify"]) == 0
    capsys.readouterr()
    for name in ("a.png", "a.gif"):
        assert main(["replay", str(simulated[0]), "--out", str(tmp_path / name)]) == 2
        assert "left out: the task 'peg' has no outline" in capsys.readouterr().err
    call = ["maps", "show", "right", "--task", "peg", "--out", str(tmp_path / "new" / "maps.png")]
    assert main(call) == 2
    assert main(["play", "--task", "peg", "--players", "scripted", "scripted", "--out", str(tmp_path / "out")]) == 2
    assert "left out: the task 'peg' has no outline" in capsys.readouterr().err.splitlines()[-1]
    assert not [path for path in tmp_path.iterdir() if path.name != "simulated"]


def test_maps_of_a_task_without_files_are_shown(peg, tmp_path, capsys):
    out = tmp_path / "maps.png"
    assert main(["maps", "show", "left", "--task", "peg", "--out", str(out), "--width", "400", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["name"], told["maps"], told["size"][0]) == ("left", 3, 400)
    assert main(["maps", "check", "lab.yaml", "--task", "peg"]) == 2
    assert "has no scenario files" in capsys.readouterr().err


def test_rerun_gets_what_the_task_has(peg, simulated, tmp_path):
    import subprocess
    import sys

    from test_replay_rerun import RERUN

    run = subprocess.run(
        [sys.executable, "-c", RERUN, str(simulated[0]), str(tmp_path / "a.rrd")],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    _, counts, times, vectors = json.loads(run.stdout.splitlines()[-1])
    steps = read_track(simulated[0]).steps
    assert counts == {
        "world/window": 1, "world/goal": 1, "world/trail/robot": 1, "world/trail/human": 1, "about": 1,
        "world/peg": steps + 1, "world/forces": steps + 1,
    }  # fmt: skip
    assert times[:2] == [0.0, 0.05]
    assert np.abs(vectors).max() == pytest.approx(0.15)


def test_a_broken_recording_is_recovered(simulated):
    path = simulated[0]
    (path.parent / "broken.mcap.part").write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    (found,) = recover(path.parent)
    assert found.status == "recovered"
    assert found.output is not None
    assert main(["replay", str(found.output), "--verify"]) == 0
    assert main(["recover", str(path.parent)]) == 0


PAIR = (PlayerSpec("scripted", "even"), PlayerSpec("scripted", "lazy"))


def _session(tmp_path, **changes) -> PlaySettings:
    return settings(tmp_path, **{"players": PAIR, "task": "peg", "maps": "right", "headless": True, **changes})


def test_two_simulated_players_play_a_session(peg, tmp_path):
    with prepared(_session(tmp_path, episodes=3), clock=SimulatedClock()) as application:
        application.run()
        told = application.summary()
    assert (told["kept"], told["outcomes"], told["complete"]) == (3, {"mark": 3}, True)
    paths = sorted(tmp_path.rglob("*.mcap"))
    episodes = [read_episode(path) for path in paths]
    assert {one.meta.map_id for one in episodes} == {"right-00", "right-01", "right-02"}
    assert all(one.meta.achieved_hz == pytest.approx(20, rel=1e-3) for one in episodes)
    assert all(one.meta.late_ticks == 0 and not one.meta.quality_flags for one in episodes)
    assert all(verify(read_track(path))["reproduced"] for path in paths)
    (header,) = tmp_path.rglob("session.json")
    assert json.loads(header.read_text(encoding="utf-8"))["settings"] == {
        "task": "peg", "maps": "right", "orientations": False, "seed": 0,
    }  # fmt: skip
    assert [(one.task, one.counts) for one in iter_recordings(tmp_path)] == [("peg", True)] * 3


def test_the_command_plays_another_task(peg, tmp_path, capsys):
    call = ["play", "--task", "peg", "--players", "scripted", "scripted:lazy", "--headless", "--countdown", "0"]
    call += ["--episodes", "1", "--out", str(tmp_path), "--json"]
    assert main(call) == 0
    assert json.loads(capsys.readouterr().out)["kept"] == 1
    assert main([*call, "--angular-limit", "pi/8"]) == 2
    assert "--angular-limit: expected no such flag" in capsys.readouterr().err
    call[call.index("scripted:lazy")] = "policy:pretrained"
    assert main(call) == 2
    assert "expected a policy that has learned the task 'peg', found 'table'" in capsys.readouterr().err
    call[call.index("policy:pretrained")] = "scripted:S01"
    assert main(call) == 2
    assert "unknown simulated pair 'S01'; available: even, lazy" in capsys.readouterr().err


def test_a_session_that_broke_off_is_judged_by_the_rate_of_its_task(peg, tmp_path):
    with prepared(_session(tmp_path, episodes=1), clock=SimulatedClock()) as application:
        application.run()
    (path,) = tmp_path.rglob("*.mcap")
    part = path.with_name("broken.mcap.part")
    part.write_bytes(path.read_bytes()[: path.stat().st_size * 3 // 4])
    (found,) = recover(path.parent)
    assert found.output is not None
    meta = read_episode(found.output).meta
    assert (meta.quality_flags, meta.late_ticks, meta.achieved_hz) == ("recovered", 0, pytest.approx(20, rel=1e-3))


def test_recordings_of_another_task_do_not_count(peg, tmp_path):
    from straight_carry import record as carry

    out = tmp_path / "recordings"
    out.mkdir()
    carry(out / "table.mcap")
    with prepared(_session(tmp_path, episodes=1), clock=SimulatedClock()) as application:
        assert application.game.folder.counts.kept.total() == 0
        application.run()
    assert sorted(one.task for one in iter_recordings(out)) == ["peg", "table"]


def test_the_screen_speaks_of_the_task(peg, tmp_path):
    players = (PlayerSpec("keyboard"), PlayerSpec("scripted", "even"))
    with prepared(_session(tmp_path, players=players, headless=False), clock=SimulatedClock()) as application:
        game = application.game
        assert pygame.display.get_caption()[0] == "copolicy: pushing a peg"
        game.roster.assign(next(iter(HALVES.values())))
        canvas = Canvas(pygame.Surface((600, 380), depth=32))
        written: list[str] = []
        canvas.text = lambda text, *rest, **named: written.append(text)
        Lobby(game).draw(canvas, 1.0)
        assert "Push the peg to the mark together." in written
        trial = game.next_trial()
        trial.begin({})
        ticker = Ticker(game.clock, 20)
        while not trial.outcome.done:
            trial.step(ticker.tick())
        assert (trial.interaction, trial.seconds) == (None, trial.steps / 20)
        result = ResultPhase(game)
        result.draw(canvas, 1.0)
        assert {"Mark", "left out: the task 'peg' has no interaction measure"} <= set(written)
        game.close_trial("keep")
        Finished(game).draw(canvas, 1.0)
        assert "successes today: 1 of 1" in written
        game.stop = "test"


@pytest.mark.parametrize(
    ("low", "high", "pushes"),
    [((-1.0,), (1.0,), (1.0, -1.0)), ((-3.0,), (2.0,), (2.0, -3.0)), ((0.0,), (1.0,), (1.0, 0))],
)
def test_one_number_is_the_stick_from_side_to_side(low, high, pushes):
    agent = PersonAgent("keyboard", action=Vector(("push",), ("N",), low, high))
    agent.device = next(iter(HALVES.values()))
    agent.sample = lambda: InputSample((0.0, 0.0), (), 0)
    for x, push in zip((1.0, -1.0), pushes, strict=True):
        agent.force = lambda sample, x=x: (x, 0.7)
        np.testing.assert_allclose(agent.act(np.zeros((1, 2)), np.arange(1)), [[push]])


@pytest.mark.parametrize(
    "action",
    [Vector(("x", "y", "z"), ("N",) * 3, (-1.0,) * 3, (1.0,) * 3), Vector(("grip",), ("N",), (0.5,), (1.0,))],
)
def test_an_action_that_no_stick_gives_is_refused(action):
    with pytest.raises(InvalidValueError, match="--players joystick: expected a task with actions of one or two"):
        PersonAgent("joystick", action=action)


def test_a_recording_of_another_task_is_not_replayed_at_a_seat(peg, simulated):
    assert ReplayAgent(simulated[0], peg).scenario == read_episode(simulated[0]).scenario
    with pytest.raises(CopolicyError, match="expected a recording of the task 'table', found one of 'peg'"):
        ReplayAgent(simulated[0])


def test_a_session_balances_what_the_task_names(peg):
    scenarios = peg.scenario_sets["right"]
    assert BalancedSchedule(scenarios, 3, 0, "P01", swap=False, task=peg).practice(0) in scenarios


def test_a_policy_holds_its_actions_at_the_rate_of_the_task(peg):
    class Counting:
        """Gives one number after the other."""

        name, task, n_obs_steps, n_action_steps, fps, keeps_history = "counting", "peg", 1, 1, 10, False

        def reset(self, seed):
            self.frame = 0

        def predict_action_chunk(self, observations):
            self.frame += 1
            return np.full((1, 1, 2), self.frame / 100)

    robot = PolicyAgent(Counting(), peg)
    rollout = Rollout(peg, [peg.scenario_sets["right"][0]], (robot, ConstantAgent(np.zeros(1))))
    taken = []
    for _ in range(6):
        rollout.step()
        taken.append(round(100 * rollout.actions[0, 0]))
    assert taken == [1, 1, 2, 2, 3, 3]


def test_the_loop_is_measured_at_the_rate_of_the_task():
    dt = 10**9 // 20
    loop = LoopStatistics(20)
    for k in range(40):
        loop.add(Tick(k * dt, k * dt + dt // 5, 0))
    assert (loop.late, loop.slow, loop.achieved_hz) == (0, False, pytest.approx(20))
    quick = LoopStatistics(40)
    for k in range(40):
        quick.add(Tick(k * dt, k * dt, 0))
    assert quick.slow


def test_a_policy_is_filmed_with_a_simulated_partner(peg):
    from copolicy.collect.demonstration.video import SIZE, demonstrate, draw_images

    class Pushing:
        """Both push to the right, gently."""

        name, task, n_obs_steps, n_action_steps, fps, keeps_history = "policy:pushing", "peg", 1, 4, 10, False

        def reset(self, seed):
            pass

        def predict_action_chunk(self, observations):
            return np.full((1, 8, 2), 0.2)

    track = demonstrate(Pushing(), peg.scenario_sets["right"][0], "lazy", task=peg)
    assert (track.episode.fps, track.episode.meta.duration_s) == (20, track.steps / 20)
    assert (track.task, track.episode.meta.controller_1) == (peg, "scripted:lazy")
    assert verify(track)["max_drift_position"] == 0.0
    frames = sum(1 for _ in draw_images(track, (SIZE[0] // 4, SIZE[1] // 4), 4, 2.0))
    assert frames == len(frame_positions(track, 4, 2.0)) + 4
    with pytest.raises(
        InvalidValueError, match="task: expected 'peg', which policy:pushing has learned, found 'table'"
    ):
        run_episodes(PolicyAgent(Pushing(), peg), "nothing", limit=1)
    Pushing.task = "table"
    with pytest.raises(InvalidValueError, match="expected a policy that has learned the task 'peg', found 'table'"):
        demonstrate(Pushing(), peg.scenario_sets["right"][0], "lazy", task=peg)
