"""Behaviours: constructed episodes of which the right events are known, and scripted players whose routes are known."""

import itertools
import json
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

from copolicy.collect.agents.scripted import ScriptedAgent
from copolicy.collect.rollout import Rollout, Trace
from copolicy.dataset.exceptions import CopolicyError
from copolicy.dataset.statistics.leadership import lead_windows
from copolicy.dataset.task import get_task
from copolicy.evaluate.behaviours import adaptation, forces, leadership, pivot
from copolicy.evaluate.behaviours.command import _markdown
from copolicy.evaluate.behaviours.counts import count
from copolicy.evaluate.behaviours.definitions import behaviours_of
from copolicy.evaluate.behaviours.motion import Motion, common_rate, least_frames
from copolicy.evaluate.cli import main
from copolicy.evaluate.file_names import file_names
from copolicy.evaluate.trajectories import Trajectory
from copolicy.evaluate.trajectory_sources import read_sources
from copolicy.tasks.table.agents.route_forces import route_forces
from copolicy.tasks.table.map_config import MapConfig

FPS = 10
MAP = MapConfig(start=(200, 300, 0.0), goal=(1000, 300), obstacles=((600, 300),))
TASK = get_task()


def _states(x: Any, y: Any = 300.0, theta: Any = 0.0):
    steps = max(np.size(value) for value in (x, y, theta))
    x, y, theta = (np.broadcast_to(value, steps) for value in (x, y, theta))
    return np.column_stack((x, y, np.cos(theta), np.sin(theta), np.zeros((steps, 3))))


def _motion(*episodes, scenario=MAP):
    columns = {"success": True, "map_id": "custom-1"}
    return Motion(TASK, [Trajectory(s, a, None, FPS, scenario, columns) for s, a in episodes], FPS)


def _along(sides, states):
    """Actions that follow the route `sides[0]` at the robot's and `sides[1]` at the human's end."""
    labels, wanted = route_forces(MAP, states)
    chosen = np.array([wanted[:, seat, labels.index(side)] for seat, side in enumerate(sides)])
    return np.nan_to_num(chosen / np.linalg.norm(chosen, axis=-1, keepdims=True)).transpose(1, 0, 2).reshape(-1, 4)


def test_who_gives_way_is_who_changes_the_route():
    states = _states(np.full(40, 420.0), 300.0)
    actions = np.concatenate((_along("LR", states[:20]), _along("RR", states[20:])))
    (event,) = adaptation.disagreements(_motion((states, actions)), None)
    assert event.details == {"robot": "L", "human": "R", "common": "R", "gave_way": "robot"}
    # The mean over half a second delays each change by up to half of it.
    assert abs(event.first) <= 2
    assert adaptation.adaptations(_motion((states, actions)), None) == [event]


def test_the_adaptations_in_which_the_robot_gave_way_are_counted_by_episode():
    states = _states(np.full(40, 420.0), 300.0)
    endings = (("LR", "RR"), ("LR", "LL"), ("LR", "LR"), ("RL", "LL"))
    episodes = [(states, np.concatenate((_along(a, states[:20]), _along(b, states[20:])))) for a, b in endings]
    assert adaptation.robot_gave_way(_motion(*episodes)).tolist() == [[1, 1], [1, 0], [0, 0], [1, 1]]


def test_an_episode_without_strategies_has_no_adaptation(monkeypatch):
    states = _states(np.full(40, 420.0), 300.0)
    actions = np.concatenate((_along("LR", states[:20]), _along("RR", states[20:])))
    motion = _motion((states, actions), (states, actions))
    found = iter((None, TASK.studies.strategy_actions(MAP, states)))
    monkeypatch.setattr(type(TASK.studies), "strategy_actions", lambda self, scenario, states: next(found))
    assert adaptation.robot_gave_way(motion).tolist() == [[0, 0], [1, 1]]


def test_a_disagreement_that_lasts_is_no_adaptation():
    states = _states(np.full(40, 420.0))
    motion = _motion((states, _along("LR", states)))
    (event,) = adaptation.disagreements(motion, None)
    assert (event.first, event.end) == (0, 40)
    assert event.details == {"robot": "L", "human": "R", "common": "", "gave_way": "nobody"}
    assert adaptation.adaptations(motion, None) == []


def test_players_who_agree_do_not_disagree():
    states = _states(np.full(40, 420.0))
    assert adaptation.disagreements(_motion((states, _along("LL", states))), None) == []


def test_without_a_choice_nobody_prefers_anything():
    preferred, margins = adaptation.preferences(("",), np.ones((5, 2, 1, 2)), np.ones((5, 2, 2)), FPS)
    assert (preferred == -1).all()
    assert not margins.any()


def test_disagreements_of_scripted_players_are_those_of_their_routes():
    """Their routes are known: what is detected is true, and who gave way is who changed the route."""
    players = ScriptedAgent.from_pair("S02", TASK), ScriptedAgent.from_pair("S02", TASK)
    maps = [TASK.scenario_sets["unseen"][index] for index in (22, 28, 40, 43, 58, 61, 64, 79)]
    rollout = Rollout(TASK, maps, players, seeds=list(range(len(maps))))
    trace, routes = Trace(rollout), [[] for _ in maps]

    class Routes:
        def step(self, rollout, actions, worlds):
            for world in worlds.tolist():
                routes[world].append([player.players[world].route_choice.route.sides for player in players])

    rollout.observers.append(Routes())
    rollout.run()
    episodes = [(TASK.states_of(trace.states(k))[:-1], trace.actions(k)) for k in range(len(maps))]
    columns = {"success": True, "map_id": "unseen-1"}
    motion = Motion(TASK, [Trajectory(*e, None, 30, m, columns) for e, m in zip(episodes, maps, strict=True)], FPS)
    events = adaptation.disagreements(motion, None)
    true = [[robot != human for robot, human in each[::3]] for each in routes]
    assert len(events) >= 2
    for event in events:
        assert np.mean(true[event.episode][event.first : event.first + 3]) > 0.5
    for event in (event for event in events if event.details["common"]):
        before, after = (
            routes[event.episode][3 * event.first],
            routes[event.episode][min(3 * event.end, len(routes[event.episode]) - 1)],
        )
        changed = [name for name, old, new in zip(TASK.spec.players, before, after, strict=True) if old != new]
        assert event.details["gave_way"] == " and ".join(changed)


def test_dissent_is_a_time_above_the_level():
    actions = np.zeros((50, 4))
    actions[10:20] = (0.4, 0, -0.4, 0)  # pulling apart along the table by 0.4
    actions[30] = (1, 0, -1, 0)  # one frame is too short
    motion = _motion((_states(np.full(50, 300.0)), actions))
    (event,) = forces.dissent(motion, None, 0.25)
    assert event[:3] == (0, 10, 20)
    assert event.score == pytest.approx(0.4)
    assert forces.dissent(motion, None, 0.75) == []


def test_passivity_is_of_one_player():
    actions = np.tile((1.0, 0, 0.5, 0), (50, 1))
    actions[10:25, 2:] = 0.05  # the human
    actions[30:45] = 0.0  # both rest
    motion = _motion((_states(np.full(50, 300.0)), actions))
    (event,) = forces.passivity(motion, None, 1)
    assert event[:3] == (0, 10, 25)
    assert event.score == pytest.approx(1.5)
    assert forces.passivity(motion, None, 0) == []


def test_leadership_switches_where_the_order_of_actions_does():
    rng = np.random.default_rng(0)
    signal = np.repeat(rng.normal(size=80), 2).clip(-1, 1)
    first, second = signal.copy(), signal.copy()
    second[2:80], first[82:] = signal[:78], signal[80:-2]  # the human follows by 0.2 s, then the robot does
    zero = np.zeros_like(first)
    actions = np.column_stack((first, zero, second, zero))
    events = leadership.leadership_switches(_motion((_states(np.full(len(first), 300.0)), actions)), None)
    assert [event.details for event in events] == [{"from": "robot", "to": "human"}]
    assert events[0].first <= 80 <= events[0].end


def test_a_pivot_is_a_turn_about_one_end_beside_an_obstacle():
    theta = np.concatenate((np.zeros(5), np.linspace(0, 1.2, 25), np.full(5, 1.2)))
    # The human's end stays at (480, 300); the centre is 75.5 px from it.
    hand = np.array(TASK.required_outline.hands[1])
    x = 480 - hand[0] * np.cos(theta) - hand[1] * np.sin(theta)
    y = 300 + hand[0] * np.sin(theta) - hand[1] * np.cos(theta)
    near = MapConfig(start=(200, 300, 0.0), goal=(1000, 300), obstacles=((560, 360),))
    far = MapConfig(start=(200, 300, 0.0), goal=(1000, 300), obstacles=((1000, 500),))
    actions = np.zeros((35, 4))
    (event,) = pivot.pivots(_motion((_states(x, y, theta), actions), scenario=near), None)
    assert 1.0 <= event.score <= 1.2
    assert pivot.pivots(_motion((_states(x, y, theta), actions), scenario=far), None) == []
    # A turn about the centre is none.
    assert pivot.pivots(_motion((_states(480.0, 300.0, theta), actions), scenario=near), None) == []


def test_a_pivot_is_of_its_episode():
    """Angles and obstacles are those of the episode, whatever its place."""
    theta = np.concatenate((np.zeros(5), np.linspace(0, 1.2, 25), np.full(5, 1.2)))
    hand = np.array(TASK.required_outline.hands[1])
    x = 480 - hand[0] * np.cos(theta) - hand[1] * np.sin(theta)
    y = 300 + hand[0] * np.sin(theta) - hand[1] * np.cos(theta)
    maps = [
        MapConfig(start=(200, 300, 0.0), goal=(1000, 300), obstacles=(obstacle,))
        for obstacle in ((1000, 500), (560, 360))
    ]
    columns, carry = {"success": True, "map_id": "custom-1"}, (_states(x, y, theta), np.zeros((35, 4)))
    motion = Motion(TASK, [Trajectory(*carry, None, FPS, scenario, columns) for scenario in maps], FPS)
    (event,) = pivot.pivots(motion, None)
    assert event.episode == 1
    assert 1.0 <= event.score <= 1.2
    (event,) = pivot.pivots(motion, np.array([1, 0]))  # each with the obstacles of the other
    assert event.episode == 0
    assert 1.0 <= event.score <= 1.2


def test_a_time_is_not_shorter_at_a_low_rate():
    assert [least_frames(*each) for each in ((0.2, 10), (0.3, 10), (1.0, 10), (0.2, 6), (0.5, 5), (0.2, 1))] == [
        2, 3, 10, 2, 3, 1,
    ]  # fmt: skip
    actions = np.zeros((12, 4))
    actions[2] = actions[6:8] = (1, 0, -1, 0)  # 1/6 s and 1/3 s
    columns = {"success": True, "map_id": "custom-1"}
    motion = Motion(TASK, [Trajectory(_states(np.full(12, 300.0)), actions, None, 6, MAP, columns)], 6)
    (event,) = forces.dissent(motion, None, 0.25)
    assert (event.first, event.end) == (6, 8)


def test_a_leader_at_a_low_rate_is_steady_for_half_a_second_too():
    """At 5 Hz the windows are 0.2 s apart, so that three of them are the first half of a second."""
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, size=(600, 4))
    columns = {"success": True, "map_id": "custom-1"}
    motion = Motion(TASK, [Trajectory(_states(np.full(600, 300.0)), actions, None, 5, MAP, columns)], 5)
    runs = [(leader, len(list(group))) for leader, group in itertools.groupby(lead_windows(motion.frames).leader)]

    def switches(shortest_s: float) -> int:
        steady = [leader for leader, windows in runs if leader and windows * 0.2 >= shortest_s]
        return sum(first != second for first, second in itertools.pairwise(steady))

    assert len(leadership.leadership_switches(motion, None)) == switches(0.5)
    assert switches(0.5) > switches(1.0) > 0


def test_chance_is_the_null_distribution():
    """Players who act independently dissent as often as by chance; players who do the same dissent less often."""
    rng = np.random.default_rng(1)
    behaviour = next(each for each in behaviours_of(TASK) if each.name == "dissent_0.25")
    independent, equal = [], []
    for _ in range(12):
        robot, human = np.sign(uniform_filter1d(rng.normal(size=(2, 400)), 15, axis=1)) * 0.6
        zero, states = np.zeros(400), _states(np.full(400, 300.0))
        independent.append((states, np.column_stack((robot, zero, human, zero))))
        equal.append((states, np.column_stack((robot, zero, robot, zero))))
    rates = [count(behaviour, _motion(*episodes), 0)[0]["per_minute"] for episodes in (independent, equal)]
    assert rates[0]["null"]["p"] > 0.05
    assert rates[1]["value"] == 0
    assert rates[1]["null"]["p"] == pytest.approx(1 / 40)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A result of two scripted robots with trajectories."""
    from test_eval_partner import MAPS, ROBOTS

    from copolicy.evaluate.partner_study.study import run_with_partners
    from copolicy.evaluate.trajectories import write_trajectories
    from copolicy.tasks.table.physics import Physics

    folder = tmp_path_factory.mktemp("study")
    episodes = [
        (name, episode)
        for name in ("never-yields", "passive")
        for episode in run_with_partners(ROBOTS[name], MAPS[:2], ["stubborn"], Physics(step_limit=150))
    ]
    write_trajectories(folder / "result.trajectories.parquet", TASK, "simulated", episodes)
    return folder / "result.json"


def test_the_command_counts_each_robot(study, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["behaviours", f"p={study}", "--out", str(out), "--json"]) == 0
    result = json.loads((out / "behaviours.json").read_text(encoding="utf-8"))
    assert list(result["methods"]) == ["p: never-yields", "p: passive"]
    passive = result["methods"]["p: passive"]
    assert passive["passivity_robot"]["episodes"]["value"] == 1.0
    assert passive["label"] == "simulated"
    assert result["methods"]["p: never-yields"]["passivity_robot"]["number"] == 0
    clearest = passive["passivity_robot"]["clearest"]
    assert clearest["partner"] == "stubborn"
    video = out / "passivity_robot-p_passive.gif"
    assert video.read_bytes()[:4] == b"GIF8"
    assert str(out / "behaviours.md") in capsys.readouterr().out
    text = (out / "behaviours.md").read_text(encoding="utf-8")
    assert "| passivity_robot |" in text
    # The episodes are on two maps.
    assert passive["passivity_robot"]["per_minute"]["resampled"] == "episodes"
    assert "intervals are over maps, of fewer than 5 maps over episodes" in text
    assert main(["behaviours", str(study), "--out", str(out)]) == 2


def test_videos_of_names_that_are_alike_are_two_files(study, tmp_path, capsys):
    assert main(["behaviours", f"a b={study}#passive", f"a_b={study}#passive", "--out", str(tmp_path), "--json"]) == 0
    videos = list(tmp_path.glob("passivity_robot-*.gif"))
    assert len(videos) == 2
    assert json.loads(capsys.readouterr().out)["videos"] == len(list(tmp_path.glob("*.gif")))
    assert file_names(["a b", "a_b", "c"])["c"] == "c"


def test_who_gave_way_is_named_as_the_players_are():
    found = {"adaptation": {"per_minute": {"value": None}, "episodes": {"value": 1.0},
             "details": {"gave_way": {"left": 2, "left and right": 1}}}, "label": "", "episodes": 1}  # fmt: skip
    adapted = [each for each in behaviours_of(TASK) if each.name == "adaptation"]
    result = {"methods": {"m": found}, "definitions": {}, "not_counted": {}}
    text = _markdown(result, adapted, ("left", "right"))
    assert "| method | left | right | left and right |\n| --- | --- | --- | --- |\n| m | 2 | 0 | 1 |" in text


def test_sources_are_methods_of_one_name_each(study):
    _, sources = read_sources([f"p={study}"])
    assert [source.name for source in sources] == ["p: never-yields", "p: passive"]
    assert common_rate([30, 20]) == 10
    assert common_rate([30], 20) == 15
    with pytest.raises(CopolicyError, match="expected different names"):
        read_sources([str(study), str(study)])
