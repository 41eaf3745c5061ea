"""Scripted players: success, independence of the two players, and how they settle on a route."""

import math
from collections import Counter
from dataclasses import dataclass
from itertools import cycle

import numpy as np
import pytest

from copolicy.dataset.exceptions import InvalidValueError, ShapeError, UnknownNameError
from copolicy.tasks.table.agents import PAIRS, PlayerProfile, grid, simulated_pair
from copolicy.tasks.table.agents.clearance import square_clearance, wall_clearance
from copolicy.tasks.table.agents.cost_to_go import routes
from copolicy.tasks.table.agents.route_choice import PartnerForce
from copolicy.tasks.table.agents.scripted_player import ScriptedPlayer
from copolicy.tasks.table.features import state_vector, theta_of
from copolicy.tasks.table.interaction import interaction_force
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import MAP_SETS, map_set
from copolicy.tasks.table.routes import route_class
from copolicy.tasks.table.world import TableWorld

ONE_OBSTACLE = MapConfig((240.0, 300.0, math.pi), (960.0, 300.0), ((600.0, 300.0),))


@dataclass
class Run:
    """One episode of two players; `chosen` are the routes that they chose at the start."""

    success: bool
    states: np.ndarray
    actions: np.ndarray
    chosen: tuple[str, str]
    changes: tuple[int, int]
    route: str

    @property
    def disagreed(self) -> bool:
        return self.chosen[0] != self.chosen[1]

    @property
    def force(self) -> np.ndarray:
        return np.abs(interaction_force(theta_of(self.states), self.actions))


def run_pair(config: MapConfig, players: tuple[ScriptedPlayer, ScriptedPlayer]) -> Run:
    world = TableWorld(config)
    chosen = (players[0].route_choice.route.sides, players[1].route_choice.route.sides)
    states, actions = [world.observation], []
    outcome = None
    while outcome is None or not outcome.done:
        actions.append(np.concatenate([player.act(states[-1]) for player in players]))
        outcome = world.step(actions[-1])
        states.append(world.observation)
    route = route_class(np.array(states)[:, :2], config)
    changes = (players[0].route_choice.changes, players[1].route_choice.changes)
    return Run(outcome.success, np.array(states[:-1]), np.array(actions), chosen, changes, route)


def run_all(maps, seed: int = 0) -> list[Run]:
    return [
        run_pair(config, simulated_pair(config, pair, seed + k))
        for k, (config, pair) in enumerate(zip(maps, cycle(PAIRS), strict=False))
    ]


@pytest.fixture(scope="module")
def training() -> list[Run]:
    return run_all(MAP_SETS["training"] * 2)


@pytest.fixture(scope="module")
def unseen() -> list[Run]:
    return run_all(MAP_SETS["unseen"])


def success_rate(runs: list[Run]) -> float:
    return float(np.mean([run.success for run in runs]))


def test_pairs_reach_the_goal_on_the_training_maps(training):
    assert success_rate(training) >= 0.97
    assert 430 < np.mean([len(run.actions) for run in training]) < 530  # people: 479


def test_pairs_reach_the_goal_on_the_holdout_maps():
    assert success_rate(run_all(MAP_SETS["holdout"])) >= 0.95


def test_pairs_reach_the_goal_on_the_unseen_maps(unseen):
    assert success_rate(unseen) >= 0.95


@pytest.mark.parametrize("name", ["training", "unseen"])
def test_pairs_reach_the_goal_from_any_orientation(name):
    assert success_rate(run_all(map_set(name, orientations=True)[::5])) >= 0.93


def test_table_is_turned_on_the_way(training):
    turned = [np.ptp(np.unwrap(theta_of(run.states))) for run in training]
    assert np.mean(turned) > math.radians(25)
    quarter_turned = MapConfig((240.0, 300.0, math.pi / 2), (960.0, 300.0), ((600.0, 180.0), (600.0, 420.0)))
    run = run_pair(quarter_turned, simulated_pair(quarter_turned, "S01", 2))
    assert run.success
    assert run.route == "LR"  # between the two: 190 px, too narrow for the table as it stands at the start
    inside = run.states[np.abs(run.states[:, 0] - 600) < 25]
    assert np.all(np.abs(inside[:, 3]) < 0.6)


def test_the_table_takes_the_route_that_both_chose(training, unseen):
    agreed = [run for run in training + unseen if not run.disagreed and sum(run.changes) == 0]
    assert len(agreed) > 100
    same = [run.route == run.chosen[0] for run in agreed]
    # The side of an obstacle that lies off the way is decided by where the table happens to touch the goal.
    assert np.mean(same) > 0.95


def test_some_pairs_disagree_and_one_player_yields(training, unseen):
    runs = training + unseen
    disagreed = [run for run in runs if run.disagreed]
    agreed = [run for run in runs if not run.disagreed]
    assert 0.1 < len(disagreed) / len(runs) < 0.5
    force = [np.mean([run.force[:90].mean() for run in group]) for group in (disagreed, agreed)]
    assert force[0] > 1.5 * force[1]
    settled = [sum(run.changes) for run in disagreed]
    assert np.median(settled) == 1
    assert success_rate(disagreed) >= 0.9


def test_the_patient_leader_prevails():
    """In pair S03 the human's seat is more patient: where the two disagree, the robot's seat yields."""
    yielded = Counter()
    for seed in range(40):
        run = run_pair(ONE_OBSTACLE, simulated_pair(ONE_OBSTACLE, "S03", seed))
        if run.disagreed:
            yielded["robot"] += run.changes[0] > run.changes[1]
            yielded["human"] += run.changes[1] > run.changes[0]
    assert yielded["robot"] >= 5
    assert yielded["robot"] > 4 * yielded["human"]


def test_both_sides_of_an_obstacle_are_taken():
    taken = Counter(run_pair(ONE_OBSTACLE, simulated_pair(ONE_OBSTACLE, "S01", seed)).route for seed in range(20))
    assert min(taken["L"], taken["R"]) >= 4


def test_left_bias_decides_between_equal_routes():
    def sides(bias: float) -> Counter:
        profile = PlayerProfile(left_bias=bias)
        players = (ScriptedPlayer(0, ONE_OBSTACLE, profile, seed) for seed in range(50))
        return Counter(player.route_choice.route.sides for player in players)

    assert sides(200.0)["L"] > 40
    assert sides(-200.0)["R"] > 40


def test_equal_seeds_give_equal_bits():
    config = MAP_SETS["training"][6]
    first, second, other = (run_pair(config, simulated_pair(config, "S04", seed)) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.actions, second.actions)
    np.testing.assert_array_equal(first.states, second.states)
    assert not np.array_equal(first.actions[:100], other.actions[:100])


def test_a_player_depends_on_its_seed_and_the_states_alone():
    config = MAP_SETS["training"][6]
    robot, human = simulated_pair(config, "S02", 11)
    run = run_pair(config, (robot, human))
    for player in (0, 1):
        alone = simulated_pair(config, "S02", 11)[player]  # the partner's `act` is not called
        replayed = np.array([alone.act(state) for state in run.states])
        np.testing.assert_array_equal(replayed, run.actions[:, 2 * player : 2 * player + 2])


def test_a_player_reacts_after_its_delay():
    def pushes(jump_at: int) -> np.ndarray:
        player = ScriptedPlayer(1, ONE_OBSTACLE, PlayerProfile(delay_steps=5), seed=0)
        # Not by whole cells of the grid, for which the displacement to the target would be the same.
        states = [state_vector((240.0, 300.0 if k < jump_at else 340.0, 3.14), (0.0, 0.0, 0.0)) for k in range(40)]
        return np.array([player.act(state) for state in states])

    before, after = pushes(jump_at=99), pushes(jump_at=20)
    np.testing.assert_array_equal(before[:25], after[:25])
    assert not np.array_equal(before[25], after[25])


def test_forces_stay_within_a_full_force(training):
    actions = np.concatenate([run.actions for run in training])
    assert np.abs(actions).max() <= 1.0
    assert np.all(np.isfinite(actions))


def test_a_player_without_a_partner_is_slower():
    robot, _ = simulated_pair(ONE_OBSTACLE, "S01", 0)
    world = TableWorld(ONE_OBSTACLE)
    outcome = None
    while outcome is None or not outcome.done:
        outcome = world.step((*robot.act(world.observation), 0.0, 0.0))
    assert outcome.success
    assert world.step_count > 600


def test_partner_force_is_estimated_from_the_motion():
    world = TableWorld(ONE_OBSTACLE)
    world.reset((600.0, 450.0, 0.0))
    estimate = PartnerForce()
    for _ in range(60):
        estimate.update(world.velocity[:2], (0.3, -0.2))
        world.step((0.3, -0.2, -0.5, 0.1))
    assert (estimate.x, estimate.y) == pytest.approx((-0.5, 0.1), abs=0.01)


def test_clearance_on_the_grid_agrees_with_the_world():
    rng = np.random.default_rng(0)
    world = TableWorld(ONE_OBSTACLE)
    poses = np.column_stack((rng.uniform(80, 1120, 4000), rng.uniform(80, 520, 4000), rng.uniform(0, 7, 4000)))
    contacts = np.array([world.contact(pose) for pose in poses])
    x, y, theta = poses.T
    space = square_clearance(x, y, theta, ONE_OBSTACLE.obstacles[0], ONE_OBSTACLE.obstacle_size)
    assert not np.any(contacts[space > 6, 0])
    assert np.mean(contacts[space < -6, 0]) > 0.85  # the discs fill the table's gaps and are symmetric
    walls = wall_clearance(x, y, theta)
    assert not np.any(contacts[walls > 2, 2])
    assert np.all(contacts[walls < -2, 2])


def test_cost_to_go_counts_the_path_and_bars_the_wrong_side():
    left, right = routes(ONE_OBSTACLE, clearance=2.0)
    assert (left.sides, right.sides) == ("L", "R")
    before, above = grid.cell(240.0, 300.0, 0.0), grid.cell(560.0, 150.0, 0.0)
    free = 960 - 240 - 95.5 - 46  # the path to the first contact
    assert free < left.cost[before] < free + 400
    assert left.cost[before] == pytest.approx(right.cost[before], rel=0.1)
    assert right.cost[above] < 450
    assert left.cost[above] > right.cost[above] + 250  # back and around the other side


def test_maps_with_permuted_obstacles_share_their_routes():
    config = MAP_SETS["training"][6]
    permuted = MapConfig((300.0, 300.0, 0.0), config.goal, config.obstacles[::-1], config.obstacle_size)
    assert routes(config, 2.0) is routes(permuted, 2.0)


def test_goals_to_the_left_are_reached_too():
    config = MapConfig((960.0, 300.0, 0.0), (240.0, 300.0), ((600.0, 300.0),))
    runs = [run_pair(config, simulated_pair(config, "S05", seed)) for seed in range(6)]
    assert all(run.success for run in runs)
    assert all(run.route == run.chosen[0] for run in runs if not run.disagreed and sum(run.changes) == 0)


@pytest.mark.parametrize(
    ("make", "error", "text"),
    [
        (lambda: simulated_pair(ONE_OBSTACLE, "S99", 0), UnknownNameError, "unknown simulated pair 'S99'; available: "),
        (lambda: simulated_pair(ONE_OBSTACLE, "S01", -1), InvalidValueError, "seed: expected a whole number, not neg"),
        (
            lambda: ScriptedPlayer(2, ONE_OBSTACLE, PlayerProfile(), 0),
            InvalidValueError,
            "player: expected 0 or 1, found 2",
        ),
        (
            lambda: PlayerProfile(speed=0.0),
            InvalidValueError,
            "PlayerProfile.speed: expected a positive number, found 0.0",
        ),
        (
            lambda: PlayerProfile(noise=-0.1),
            InvalidValueError,
            "PlayerProfile.noise: expected a finite number, not negative, f",
        ),
        (
            lambda: PlayerProfile(impulsiveness=1.5),
            InvalidValueError,
            "PlayerProfile.impulsiveness: expected at most 1, found 1.5",
        ),
        (
            lambda: routes(MapConfig((240, 300, 0), (960, 300), ((960, 300),), 150), 2.0),
            InvalidValueError,
            "map: expected a goal that the table can touch, found ((960.0, 300.0), ((960.0, 300.0),))",
        ),
        (
            lambda: ScriptedPlayer(0, ONE_OBSTACLE, PlayerProfile(), 0).act(np.zeros(4)),
            ShapeError,
            "state: expected shape (7,), got (4,)",
        ),
    ],
)  # fmt: skip
def test_errors_name_what_is_wrong(make, error, text):
    with pytest.raises(error) as raised:
        make()
    assert str(raised.value).startswith(text)
