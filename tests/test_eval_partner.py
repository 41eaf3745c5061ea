"""Simulated partners at the human seat: are they different people, is the protocol kept, what does a study say?"""

import hashlib
import json
import math
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from policy_runs import save_run
from untrained_policy import save_untrained_policy

from copolicy.cards.cli import main as cards
from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.dataset.task import get_task
from copolicy.evaluate.cli import main
from copolicy.evaluate.partner_study import study
from copolicy.evaluate.partner_study.configurations import study_configurations
from copolicy.evaluate.partner_study.episode_result import PartnerEpisodeResult
from copolicy.evaluate.partner_study.robots import hidden_partner_robot, policy_robot, scripted_robots, split_robot
from copolicy.evaluate.partner_study.study import run_with_partners
from copolicy.evaluate.partner_study.summary import differences, summarise_with_partners
from copolicy.tasks.table.agents import PlayerProfile
from copolicy.tasks.table.agents.players import simulated_partner
from copolicy.tasks.table.agents.profiles import PARTNERS
from copolicy.tasks.table.agents.scripted_player import ScriptedPlayer
from copolicy.tasks.table.features import environment_state
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.world import TableWorld

MAPS = MAP_SETS["training"][6:84:14]
ROBOTS = scripted_robots(get_task())


@pytest.fixture(scope="module")
def measured_kinds():
    """What an observer measures of each kind, with the same usual robot on the same maps."""
    measured = {}
    for kind in PARTNERS:
        seconds, changes, effort, unrest = [], [], [], []
        for seed, config in enumerate(MAPS):
            robot, partner = ScriptedPlayer(0, config, PlayerProfile(), seed), simulated_partner(config, kind, seed)
            world, forces, outcome = TableWorld(config, Physics(step_limit=2000)), [], None
            while outcome is None or not outcome.done:
                state = world.observation
                forces.append(partner.act(state))
                outcome = world.step(np.concatenate((robot.act(state), forces[-1])))
            seconds.append(len(forces) / 30)
            changes.append(partner.route_choice.changes)
            effort.append(np.hypot(*np.transpose(forces)).mean())
            unrest.append(np.abs(np.diff(forces, axis=0)).mean())
        measured[kind] = tuple(float(np.mean(one)) for one in (seconds, changes, effort, unrest))
    return measured


def test_kinds_of_partner_differ_in_what_can_be_measured(measured_kinds):
    seconds, changes, effort, unrest = ({kind: one[k] for kind, one in measured_kinds.items()} for k in range(4))
    assert seconds["slow"] == max(seconds.values()) > 1.2 * seconds["stubborn"]
    assert changes["stubborn"] < min(changes["follower"], changes["erratic"])
    assert effort["follower"] < 0.65 * effort["stubborn"]
    assert unrest["erratic"] > 1.5 * max(unrest[kind] for kind in ("stubborn", "follower", "slow"))


def test_a_partner_wants_its_route_whoever_the_other_is():
    first, second = (simulated_partner(MAPS[0], "erratic", 5) for _ in range(2))
    assert first.route_choice.route.sides == second.route_choice.route.sides
    wishes = {simulated_partner(MAPS[0], "erratic", seed).route_choice.route.sides for seed in range(12)}
    assert len(wishes) > 2
    with pytest.raises(UnknownNameError) as error:
        simulated_partner(MAPS[0], "kind", 0)
    assert str(error.value) == "unknown kind of partner 'kind'; available: erratic, follower, slow, stubborn"


def test_sixty_configurations_are_spread_over_a_set():
    starts = study_configurations("unseen", 60)
    assert len(set(starts)) == 60
    assert Counter(round(math.degrees(one.start[2])) for one in starts) == {0: 15, 90: 15, 180: 15, 270: 15}
    assert set(Counter(one.obstacles for one in starts).values()) <= {8, 12}  # 7 layouts, two or three times four
    assert set(Counter(one.goal for one in starts).values()) == {20}
    assert set(Counter(one.start[1] for one in starts).values()) <= {12, 16}
    holdout = study_configurations("holdout", 60)
    assert len({one.digest for one in holdout}) == 60  # the set repeats maps, the study does not
    assert len({one.start for one in study_configurations("paper36", 8)}) > 4
    with pytest.raises(InvalidValueError) as error:
        study_configurations("unseen", 58)
    assert str(error.value) == "--configurations: expected a multiple of 4 from 4 to 336, found 58"


class CountingPolicy:
    """Predicts forces that tell the chunk's number, and remembers what it was shown."""

    name, task, n_obs_steps, fps, keeps_history = "counter", "table", 3, 10, False

    def __init__(self, n_action_steps=1):
        self.n_action_steps = n_action_steps
        self.calls: list[dict[str, np.ndarray]] = []
        self.policy: SimpleNamespace | None = None  # LeRobot's policy, of which the configuration is read

    def describe(self):
        return {}

    def reset(self, seed):
        """Nothing here is random."""

    def predict_action_chunk(self, history):
        self.calls.append(history)
        plans = np.zeros((len(history[STATE]), 10, 4))
        plans[:, :, 0] = 0.01 * len(self.calls)
        plans[:, :, 1] = 0.001 * np.arange(10)
        plans[:, :, 2:] = 1.0  # what it expects of the partner, which is not asked
        return plans


def test_one_action_a_plan_held_for_three_steps_from_the_newest_history():
    planner = CountingPolicy()
    robot = policy_robot("counter", planner)  # pyright: ignore[reportArgumentType]
    (episode,) = run_with_partners(robot, MAPS[:1], ["stubborn"], Physics(step_limit=31))
    assert episode.steps == 31
    assert episode.chunks == len(planner.calls) == 11
    np.testing.assert_allclose(episode.actions[:, 0], np.repeat(0.01 * np.arange(1, 12), 3)[:31])
    assert not episode.actions[:, 1].any()
    world, states = TableWorld(MAPS[0]), []
    for action in episode.actions:
        states.append(world.observation)
        world.step(action)
    first, last = planner.calls[0], planner.calls[10]
    np.testing.assert_array_equal(first[STATE], np.tile(states[0], (1, 3, 1)))
    assert not first[HUMAN_ACTION].any()
    # The newest observation is that of the present step, and the past human action what the partner really did.
    np.testing.assert_array_equal(last[STATE][0], [states[24], states[27], states[30]])
    done = episode.actions[:30, 2:].reshape(10, 3, 2).mean(axis=1)
    np.testing.assert_allclose(last[HUMAN_ACTION][0], done[7:10])
    np.testing.assert_array_equal(last[ENVIRONMENT_STATE][0], np.tile(environment_state(MAPS[0]), (3, 1)))


def test_a_robot_can_be_shown_zeros_as_the_past_action_of_its_partner():
    planner = CountingPolicy()
    planner.policy = SimpleNamespace(config=SimpleNamespace(past_human_action=True))
    robot = hidden_partner_robot("counter", planner)  # pyright: ignore[reportArgumentType]
    (hidden,) = run_with_partners(robot, MAPS[:1], ["stubborn"], Physics(step_limit=31))
    calls, planner.calls = planner.calls, []
    shown = policy_robot("counter", planner)  # pyright: ignore[reportArgumentType]
    (open_eyed,) = run_with_partners(shown, MAPS[:1], ["stubborn"], Physics(step_limit=31))
    np.testing.assert_array_equal(hidden.actions, open_eyed.actions)  # this policy makes nothing of it
    assert len(calls) == len(planner.calls) == 11
    assert planner.calls[-1][HUMAN_ACTION].any()
    for seen, all_seen in zip(calls, planner.calls, strict=True):
        assert not seen[HUMAN_ACTION].any()
        assert seen[HUMAN_ACTION].shape == all_seen[HUMAN_ACTION].shape
        np.testing.assert_array_equal(seen[STATE], all_seen[STATE])
    assert robot.describe() == {"shown_past_human_action": "zero"}


def test_nothing_can_be_hidden_from_a_policy_that_does_not_observe_it():
    planner = CountingPolicy()
    planner.policy = SimpleNamespace(config=SimpleNamespace(past_human_action=False))
    with pytest.raises(InvalidValueError, match="codp: expected a policy that observes the human's past action"):
        hidden_partner_robot("codp", planner)  # pyright: ignore[reportArgumentType]


def test_the_option_of_a_robot_is_no_part_of_its_path():
    assert split_robot("mine=runs/a,b,past_human_action=zero") == ("mine", "runs/a,b", True)
    assert split_robot("runs/a=b/c") == ("", "runs/a=b/c", False)


def test_more_actions_a_plan_are_executed_in_turn():
    planner = CountingPolicy(2)
    robot = policy_robot("counter", planner)  # pyright: ignore[reportArgumentType]
    (episode,) = run_with_partners(robot, MAPS[:1], ["slow"], Physics(step_limit=12))
    np.testing.assert_allclose(episode.actions[::3, :2], [[0.01, 0], [0.01, 0.001], [0.02, 0], [0.02, 0.001]])
    assert len(planner.calls) == 2


def test_every_robot_meets_the_same_partner():
    physics = Physics(step_limit=40)
    kinds = ["stubborn", "erratic"]
    one = run_with_partners(ROBOTS["passive"], MAPS[:2], kinds, physics, repeats=2)
    other = run_with_partners(ROBOTS["never-yields"], MAPS[:2], kinds, physics, repeats=2, seed=9)
    assert [(o.map_index, o.partner, o.repeat) for o in one] == [
        (m, k, r) for m in (0, 1) for k in kinds for r in (0, 1)
    ]
    # Before they have felt the other one they do the same; other tables have others.
    np.testing.assert_array_equal([o.actions[0, 2:] for o in one], [o.actions[0, 2:] for o in other])
    assert len({tuple(o.actions[0, 2:]) for o in one}) == 8
    assert not np.concatenate([o.actions for o in one])[:, :2].any()
    again = run_with_partners(ROBOTS["passive"], MAPS[:2], kinds, physics, repeats=2)
    np.testing.assert_array_equal([o.path for o in one], [o.path for o in again])
    changed = run_with_partners(ROBOTS["passive"], MAPS[:1], ["erratic"], physics, partner_seed=1)
    assert (changed[0].actions[0] != one[2].actions[0]).any()


def _episode(actions, path, still, success=True):
    steps = len(actions)
    return PartnerEpisodeResult(
        0, MAPS[0], 0, success, "goal", 1, np.array(path, float), np.zeros(steps), "slow", np.array(still, bool), 2,
        actions=np.array(actions, float),
    )  # fmt: skip


def test_work_is_shared_by_what_pushes_along_the_way():
    # 10 px to the right: the robot pushes with half a force, the partner with a full one; then one pulls back.
    episode = _episode([[0.5, 9, 1, 0], [-1, 0, 1, 0]], [(0, 0), (10, 0), (20, 0)], [0, 0])
    assert episode.work == (5.0, 20.0)
    assert episode.robot_share == 0.2
    assert _episode([[0, 0, 0, 0]], [(0, 0), (0, 0)], [0]).robot_share == 0.0


def test_a_deadlock_is_a_second_of_standing():
    still = [0] * 10 + [1] * 29 + [0] + [1] * 30 + [0] * 5 + [1] * 45
    episode = _episode(np.zeros((len(still), 4)), np.zeros((len(still) + 1, 2)), still)
    assert episode.deadlock_s == 2.5
    summary = summarise_with_partners([episode], None)
    assert summary["deadlock"] == {"time_share": pytest.approx(75 / 120), "episode_share": 1.0}
    assert summary["by_partner"]["slow"]["partner_changes"] == 2
    assert summary["planning_ms_per_call"]["n"] == 0


def test_differences_are_paired_and_times_count_where_both_succeed():
    fast = _episode(np.zeros((30, 4)), np.zeros((31, 2)), np.zeros(30))
    slow = _episode(np.zeros((60, 4)), np.zeros((61, 2)), np.zeros(60))
    lost = _episode(np.zeros((90, 4)), np.zeros((91, 2)), np.zeros(90), success=False)
    found = differences([fast], [slow])["all"]
    assert found["time_s"] == {"mean": -1.0, "standard_error": None, "bootstrap_95": None, "pairs": 1, "maps": 1}
    assert differences([fast], [lost])["slow"]["success"]["mean"] == 1.0
    assert differences([fast], [lost])["slow"]["time_s"]["mean"] is None


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory) -> Path:
    """An untrained co-policy as a checkpoint folder."""
    return save_untrained_policy(tmp_path_factory.mktemp("checkpoint"))


def _command(checkpoint, out, *flags):
    limits = ("--configurations", "4", "--step-limit", "30", "--maps", "unseen")
    return main(["partner", str(checkpoint), "--out", str(out), *limits, *flags])


def test_the_command_writes_every_robots_episodes_and_the_card_reads_them(checkpoint, tmp_path, capsys):
    out = tmp_path / "results" / "partner.json"
    flags = ["--partners", "slow", "stubborn", "--repeats", "2", "--json"]
    assert main(["partner", f"ours={checkpoint}", "--out", str(out), "--configurations", "4", "--step-limit", "30",
                 *flags]) == 0  # fmt: skip
    told = json.loads(capsys.readouterr().out)
    assert list(told["robots"]) == ["ours", "passive", "never-yields"]
    result = json.loads(out.read_text(encoding="utf-8"))
    assert result["study"] == "partner"
    assert "SIMULATED" in result["label"]
    assert "no person took part" in result["label"]
    assert result["name"] == "ours"
    assert result["settings"]["configurations"] == 4
    assert result["settings"]["actions_per_plan"] == 1
    assert result["settings"]["hold"] == 3
    assert list(result["settings"]["partners"]) == ["slow", "stubborn"]
    assert len(result["episodes"]) == 16 == result["summary"]["success"]["episodes"]
    assert {row["partner"] for row in result["episodes"]} == {"slow", "stubborn"}
    assert {row["steps"] for row in result["episodes"]} == {30}
    assert [one["name"] for one in result["baselines"]] == ["passive", "never-yields"]
    # An untrained network plans rest, as the passive robot does: no difference at all.
    assert result["differences"]["passive"]["all"]["interaction_mean"]["mean"] == 0.0
    assert result["differences"]["never-yields"]["all"]["robot_share"]["mean"] < 0
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    copy = save_untrained_policy(tmp_path / "copy")
    card_input = tmp_path / "card.json"
    card_input.write_text(
        json.dumps({**result, "policy": {"weights_sha256": _digest(copy), "parameters": 1}}), encoding="utf-8"
    )
    assert cards(["model", str(copy), "--eval", str(card_input)]) == 0
    text = (copy / "README.md").read_text(encoding="utf-8")
    assert "With simulated partners on 4 starts of the unseen maps, 1 action(s) per chunk" in text
    assert "| never-yields | 0.0 ± 0.0 | 0.0 to 19.4 | 16 |" in text


@pytest.mark.parametrize(("flags", "of_policies"), [((), [10, 30]), (("--fps", "15"), [15, 15])])
def test_each_policy_acts_at_its_own_rate_and_other_robots_at_every_step(
    checkpoint, tmp_path, monkeypatch, flags, of_policies
):
    faster, rates = save_run(tmp_path / "run", fps=30.0), []
    original = study.run_with_partners
    monkeypatch.setattr(
        study, "run_with_partners", lambda *given, **more: rates.append(more["fps"]) or original(*given, **more)
    )
    baseline = ("--baseline", f"faster={faster}", "passive", "never-yields", "random")
    assert _command(checkpoint, tmp_path / "partner.json", "--partners", "slow", *baseline, *flags) == 0
    assert rates == [*of_policies, 30, 30, 30]
    settings = json.loads((tmp_path / "partner.json").read_text(encoding="utf-8"))["settings"]
    assert settings["fps"] == of_policies[0]


def _digest(folder):
    return hashlib.sha256((folder / "model.safetensors").read_bytes()).hexdigest()


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--partners", "kind"], "unknown kind of partner 'kind'; available: erratic, follower, slow, stubborn"),
        (["--configurations", "3"], "--configurations: expected a multiple of 4 from 4 to 336, found 3"),
        (["--repeats", "0"], "--repeats: expected at least 1, found 0"),
        (["--n-action-steps", "11"], "--n-action-steps: expected 1 to 10, the actions of a chunk, found 11"),
        (
            ["--baseline", "passive", "passive"],
            "--baseline: expected robots of different names (NAME=CKPT gives one), "
            "found ['{name}', 'passive', 'passive']",
        ),
        (["--partner-seed", "-1"], "--partner-seed: expected a whole number, not negative, found -1"),
    ],
)
def test_a_wrong_call_is_one_line(checkpoint, tmp_path, capsys, flags, message):
    assert _command(checkpoint, tmp_path / "partner.json", *flags) == 2
    name = f"policy:copolicy-{_digest(checkpoint)[:8]}"
    assert capsys.readouterr().err.strip() == f"copolicy-eval: {message.format(name=name)}"
    assert not (tmp_path / "partner.json").exists()


def test_an_existing_result_is_not_replaced(checkpoint, tmp_path, capsys):
    out = tmp_path / "partner.json"
    out.write_text("{}", encoding="utf-8")
    assert _command(checkpoint, out) == 2
    assert "nothing was overwritten" in capsys.readouterr().err
    assert out.read_text(encoding="utf-8") == "{}"
