"""Plans from one state: each goes on from there as co-planning would, and is told by the way that it took."""

import json
import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import torch
from matplotlib import image
from matplotlib.colors import to_rgb
from untrained_policy import save_untrained_policy

from copolicy.dataset import clock
from copolicy.dataset.exceptions import RunError
from copolicy.dataset.features import HUMAN_ACTION, STATE
from copolicy.evaluate.cli import main
from copolicy.evaluate.coplan.rollouts import coplan
from copolicy.evaluate.plans.figure import save_chunk_figure
from copolicy.evaluate.plans.sampling import sample_chunks
from copolicy.tasks.table.agents import simulated_pair
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.routes import route_class
from copolicy.tasks.table.world import TableWorld
from copolicy.train.checkpoint import Checkpoint

MAP = MapConfig((240.0, 300.0, 3.14), (960.0, 300.0), ((600.0, 300.0),))
BLUE, VERMILION = "#0072B2", "#D55E00"


def carried(word: str) -> tuple[np.ndarray, np.ndarray]:
    """The 10 Hz actions of a simulated pair that took a route, and its path."""
    for seed in range(40):
        world, pilots = TableWorld(MAP), simulated_pair(MAP, "S01", seed)
        actions, path, outcome = [], [world.pose[:2]], None
        while outcome is None or not outcome.done:
            actions.append(np.concatenate([pilot.act(world.observation) for pilot in pilots]))
            outcome = world.step(actions[-1])
            path.append(world.pose[:2])
        if outcome.success and route_class(np.array(path), MAP) == word:
            return clock.frame_actions(np.array(actions), 10), np.array(path)
    raise AssertionError(f"no pair of forty took {word}")


@pytest.fixture(scope="module")
def left() -> tuple[np.ndarray, np.ndarray]:
    return carried("L")


@pytest.fixture(scope="module")
def right() -> tuple[np.ndarray, np.ndarray]:
    return carried("R")


class Replayed:
    """Plans what was demonstrated: asked for whole plans, each demonstration in turn; else the one that is near."""

    name, task, n_obs_steps, n_action_steps, fps, keeps_history = "replay", "table", 3, 8, 10, False

    def __init__(self, *demonstrations: tuple[np.ndarray, np.ndarray]):
        self.n_predicted_actions: int | None = 8
        self.demonstrations = demonstrations
        self.frame = 0
        self.lengths = []

    def reset(self, seed: int) -> None:
        """A replay has no noise."""

    def predict_action_chunk(self, history: dict[str, np.ndarray]) -> np.ndarray:
        length = 10 if self.n_predicted_actions is None else self.n_predicted_actions
        self.lengths.append(length)
        places = history[STATE][:, -1, :2]
        plans = [
            self._rest(k if self.n_predicted_actions is None else self._near(place), length)
            for k, place in enumerate(places)
        ]
        self.frame += 8
        return np.array(plans)

    def _near(self, place: np.ndarray) -> int:
        paths = (path for _, path in self.demonstrations)
        return int(np.argmin([np.hypot(*(path[min(3 * self.frame, len(path) - 1)] - place)) for path in paths]))

    def _rest(self, which: int, length: int) -> np.ndarray:
        actions, _ = self.demonstrations[which % len(self.demonstrations)]
        # The goal may be a step further away than for the pair itself: go on pushing.
        return np.vstack((actions[self.frame :], np.tile(actions[-1], (length, 1))))[:length]


def decide(policy: Any, physics: Physics | None = None, **settings):
    return sample_chunks(policy, MAP, physics or Physics(), **{"samples": 4, **settings})


def test_each_plan_goes_its_way(left, right):
    planner = Replayed(left, right)
    branch_point = decide(planner)
    assert [sample.route for sample in branch_point.samples] == ["L", "R", "L", "R"]
    assert branch_point.pose == MAP.start
    np.testing.assert_array_equal(branch_point.approach, [MAP.start[:2]])
    for sample, (actions, path) in zip(branch_point.samples, (left, right) * 2, strict=True):
        np.testing.assert_array_equal(sample.chunk, actions[:10])  # whole, whatever is executed of it
        assert sample.planned_path.shape == (31, 2)
        assert np.abs(sample.planned_path - path[:31]).max() < 1.0
        assert sample.episode.path is not None
        steps = min(len(path), len(sample.episode.path))
        assert np.abs(sample.episode.path[:steps] - path[:steps]).max() < 2.0
        assert sample.episode.chunks == -(-sample.episode.steps // 24)
    # Whole plans at the state in question, only what is executed elsewhere.
    assert planner.lengths[0] == 10
    assert set(planner.lengths[1:]) == {8}


def test_plans_are_sampled_some_way_into_an_episode(left):
    branch_point = decide(Replayed(left), samples=2, seconds=1.6)
    assert branch_point.approach.shape == (49, 2)
    assert np.abs(branch_point.approach - left[1][:49]).max() < 2.0
    assert branch_point.pose[:2] == tuple(branch_point.approach[-1])
    for sample in branch_point.samples:
        assert sample.episode.path is not None
        np.testing.assert_array_equal(sample.episode.path[:49], branch_point.approach)
        np.testing.assert_array_equal(sample.planned_path[0], branch_point.approach[-1])
        np.testing.assert_array_equal(sample.chunk, left[0][16:26])
        assert sample.route == "L"


def test_a_moment_within_a_plan_is_reached_by_a_shorter_plan(left):
    branch_point = decide(Replayed(left), samples=1, seconds=0.5)
    assert branch_point.approach.shape == (16, 2)
    assert np.abs(branch_point.approach - left[1][:16]).max() < 2.0


def test_a_moment_after_the_end_is_refused(left):
    with pytest.raises(RunError, match=r"^--seconds: expected less than 1\d\.\d, when the episode ended, found"):
        decide(Replayed(left), seconds=60.0)


def test_the_route_of_an_unfinished_path_is_not_decided():
    upwards = np.tile([0.0, -1.0, 0.0, -1.0], (60, 1))
    branch_point = decide(Replayed((upwards, np.tile(MAP.start[:2], (181, 1)))))
    assert {sample.episode.reason for sample in branch_point.samples} == {"collision_wall"}
    assert {sample.route for sample in branch_point.samples} == {None}


class Swaying:
    """Forces that follow from the whole history, for as many tables as there are."""

    name, task, n_obs_steps, n_action_steps, fps, keeps_history = "swaying", "table", 3, 8, 10, False
    n_predicted_actions = 8

    def reset(self, seed: int) -> None:
        """Nothing here is random."""

    def predict_action_chunk(self, history: dict[str, np.ndarray]) -> np.ndarray:
        seen = np.concatenate([history[STATE], history[HUMAN_ACTION]], axis=-1).sum(axis=(1, 2))
        phase = seen[:, None, None] + np.arange(10)[:, None] + np.arange(4)
        return np.sin(phase)[:, : self.n_predicted_actions or 10]


def test_a_branch_goes_on_as_the_table_itself():
    physics = Physics(step_limit=200)
    (whole,) = coplan(Swaying(), [MAP], physics)
    for sample in decide(Swaying(), samples=2, seconds=2.4, physics=physics).samples:
        assert (sample.episode.reason, sample.episode.chunks) == (whole.reason, whole.chunks)
        np.testing.assert_array_equal(sample.episode.path, whole.path)
        np.testing.assert_array_equal(sample.episode.interaction, whole.interaction)


def drawn(path: Path, colour: str) -> int:
    """Pixels of about a colour."""
    return int((np.abs(image.imread(path)[..., :3] - to_rgb(colour)).max(axis=-1) < 0.06).sum())


def test_the_picture_has_a_colour_for_each_route(left, right, tmp_path):
    save_chunk_figure([decide(Replayed(left, right))], [tmp_path / "both.png"], "both")
    save_chunk_figure([decide(Replayed(left))], [tmp_path / "one.png"], "one")
    both, one = ([drawn(tmp_path / name, colour) for colour in (BLUE, VERMILION)] for name in ("both.png", "one.png"))
    assert min(both) > 100
    assert one[0] > 100
    assert one[1] < 20


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory) -> Path:
    """An untrained co-policy as a checkpoint folder."""
    return save_untrained_policy(tmp_path_factory.mktemp("checkpoint"))


def test_the_same_seed_gives_the_same_plans_and_no_two_are_alike(checkpoint):
    policy = Checkpoint(checkpoint)
    # The untrained head is zero and would plan rest from any noise.
    torch.manual_seed(0)
    for parameter in policy.policy.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    first, second, other = (
        np.array([s.chunk for s in sample_chunks(policy, MAP, Physics(step_limit=30), samples=3, seed=seed).samples])
        for seed in (4, 4, 5)
    )
    assert first.shape == (3, policy.chunk_size, 4)
    np.testing.assert_array_equal(first, second)
    assert np.abs(first - other).max() > 1e-4
    assert np.abs(first[0] - first[1]).max() > 1e-4


def command(checkpoint: Path, out: Path, *flags: str) -> int:
    settings = ("--policy", str(checkpoint), "--map", "7", "--samples", "3", "--step-limit", "60")
    return main(["plans", *settings, "--out", str(out), *flags])


def test_the_command_counts_routes_and_draws(checkpoint, tmp_path, capsys):
    out = tmp_path / "made" / "plans.png"
    assert command(checkpoint, out, "--json", "--seconds", "0.5") == 0
    # An untrained network plans rest: nothing gets anywhere, so no route is decided.
    assert json.loads(capsys.readouterr().out) == {
        "map": "unseen-07",
        "seconds": 0.5,
        "samples": 3,
        "fps": 10,
        "angular_acceleration_limit": math.pi / 2,
        "routes": {},
        "ended_by": {"timeout": 3},
        "figure": str(out),
        "svg": str(out.with_suffix(".svg")),
    }
    assert out.read_bytes().startswith(b"\x89PNG")
    assert ElementTree.parse(out.with_suffix(".svg")).getroot().tag.endswith("svg")
    assert command(checkpoint, out) == 2
    assert capsys.readouterr().err == (
        f"copolicy-eval: {out}: expected a path that does not exist yet, found one; nothing was overwritten\n"
    )


def test_several_maps_are_rows_of_one_sheet(checkpoint, tmp_path, capsys):
    out = tmp_path / "plans.png"
    assert command(checkpoint, out, "--map", "7", "29", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["maps"] == {name: {"routes": {}, "ended_by": {"timeout": 3}} for name in ("unseen-07", "unseen-29")}
    assert "map" not in told
    one = tmp_path / "one.png"
    assert command(checkpoint, one) == 0
    heights = [image.imread(path).shape[0] for path in (out, one)]
    assert heights[0] > 1.7 * heights[1]
    twice = tmp_path / "twice.png"
    assert command(checkpoint, twice, "--map", "7", "7") == 0  # a map counts once
    assert image.imread(twice).shape == image.imread(one).shape


@pytest.mark.parametrize(
    ("flags", "status", "text"),
    [
        (["--map", "84"], 2, "--map: expected 0 to 83, found 84"),
        (["--map", "-1"], 2, "--map: expected 0 to 83, found -1"),
        (["--samples", "0"], 2, "--samples: expected at least 1, found 0"),
        (["--seconds", "-1"], 2, "--seconds: expected a number of at least 0, found -1.0"),
        (["--seconds", "nan"], 2, "--seconds: expected a number of at least 0, found nan"),
        (["--seconds", "5"], 1, "--seconds: expected less than 2.0, when the episode ended, found 5"),
        (["--n-action-steps", "11"], 2, "--n-action-steps: expected 1 to 10, the actions of a chunk, found 11"),
    ],
)
def test_wrong_calls_say_what_is_wrong(checkpoint, tmp_path, capsys, flags, status, text):
    assert command(checkpoint, tmp_path / "plans.png", *flags) == status
    assert capsys.readouterr().err == f"copolicy-eval: {text}\n"
    assert not (tmp_path / "plans.png").exists()


def test_a_picture_is_a_png(checkpoint, tmp_path, capsys):
    out = tmp_path / "plans.jpg"
    assert command(checkpoint, out) == 2
    assert capsys.readouterr().err == f"copolicy-eval: {out}: expected a name that ends with .png, found '.jpg'\n"
