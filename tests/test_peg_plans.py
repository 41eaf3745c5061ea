"""Figures of studies on a second task: from its outline, in one group where it has no strategy labels."""

from typing import Any

import numpy as np
import pytest
from matplotlib import image

from copolicy.dataset.exceptions import CopolicyError
from copolicy.dataset.features import ENVIRONMENT_STATE, STATE
from copolicy.evaluate.coplan.figure import save_path_figure
from copolicy.evaluate.coplan.rollouts import coplan
from copolicy.evaluate.plans.command import _counts
from copolicy.evaluate.plans.figure import save_chunk_figure
from copolicy.evaluate.plans.sampling import sample_chunks


class Pusher:
    """A policy that pushes to the mark and brakes."""

    name, task, n_obs_steps, n_action_steps, fps, keeps_history = "pusher", "peg", 2, 2, 10, False
    n_predicted_actions = None

    def reset(self, seed: int) -> None:
        """Nothing here is random."""

    def predict_action_chunk(self, observations: dict[str, np.ndarray]) -> np.ndarray:
        (place, speed), mark = observations[STATE][:, -1].T, observations[ENVIRONMENT_STATE][:, -1, 1]
        push = np.clip(2 * (mark - place) - 1.5 * speed, -1, 1)
        return np.repeat(np.stack((push, push), axis=-1)[:, None], 4, axis=1)[:, : self.n_predicted_actions]


def decide(peg: Any, settings: Any = None):
    return sample_chunks(Pusher(), peg.scenario_sets["right"][1], settings or peg.settings_type(), samples=3)


def test_plans_are_one_group(peg, tmp_path):
    branch_point = decide(peg)
    assert [sample.route for sample in branch_point.samples] == [""] * 3
    assert branch_point.pose == pytest.approx((0.5, 0.2, 0.0))
    assert branch_point.samples[0].planned_path.shape == (9, 2)
    counts = _counts(branch_point)
    assert counts["succeeded"] == {"plans": 3, "robot_first_force": [1.0], "human_first_force": [1.0]}
    assert counts["routes"] == "left out: the task 'peg' has no strategy labels"
    assert counts["ended_by"] == {"mark": 3}
    save_chunk_figure([branch_point], [tmp_path / "plans.png"], "plans")
    assert image.imread(tmp_path / "plans.png").shape[2] >= 3


def test_failures_are_drawn_too(peg, tmp_path):
    branch_point = decide(peg, peg.settings_type(step_limit=10))
    assert {sample.route for sample in branch_point.samples} == {None}
    assert _counts(branch_point)["succeeded"] == {"plans": 0}
    save_chunk_figure([branch_point], [tmp_path / "plans.png"], "plans")
    outcomes = coplan(Pusher(), peg.scenario_sets["right"], peg.settings_type())
    save_path_figure(outcomes, tmp_path / "paths.png", "paths")
    assert (tmp_path / "paths.png").stat().st_size > 1000


def test_what_cannot_be_drawn_is_refused(peg, monkeypatch):
    monkeypatch.setattr(type(peg), "outline", None)
    with pytest.raises(CopolicyError, match="left out: the task 'peg' has no outline"):
        decide(peg)
