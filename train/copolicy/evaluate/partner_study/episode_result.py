"""Measures of one episode with a simulated partner."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array

from ..coplan.rollouts import EpisodeResult
from .clearance import smallest_distance

DEADLOCK_S = 1.0
"""A stand-still of at least this long counts as a deadlock, s."""


@dataclass(frozen=True)
class PartnerEpisodeResult(EpisodeResult):
    """Result of one episode of a robot with a simulated partner.

    Attributes:
        partner: kind of the partner.
        still: `(steps,)` whether the moved object was at rest after each step; None if the task does not define it.
        partner_changes: how often the partner changed its route choice; None if it is no scripted player.
    """

    partner: str
    still: Array | None
    partner_changes: int | None
    actions: Array = field(kw_only=True, repr=False)  # required here

    @cached_property
    def forces(self) -> tuple[Array, Array] | None:
        """`(steps, 2)` forces of robot and of partner, in full forces; None if the task has no outline."""
        if self.task.outline is None:
            return None
        forces = self.task.outline.forces(self.actions)
        return forces[:, :2], forces[:, 2:]

    @property
    def work(self) -> tuple[float, float] | None:
        """Positive work of robot and partner on the tracked point, full forces x unit of the path; None if unknown.

        Work of rotation is left out: for the table it is below 1 %.
        """
        if self.forces is None or self.path is None:
            return None
        displacements = np.diff(self.path, axis=0)
        robot, partner = (float(np.einsum("ti,ti->t", force, displacements).clip(0).sum()) for force in self.forces)
        return robot, partner

    @property
    def robot_share(self) -> float | None:
        """Proportion of both players' positive work that the robot does: 0.5 is even, 0 a robot that does nothing."""
        if self.work is None:
            return None
        robot, partner = self.work
        return robot / (robot + partner) if robot + partner > 0 else 0.0

    @property
    def deadlock_s(self) -> float | None:
        """Total time in stand-stills of at least `DEADLOCK_S`, s; None if the task does not define them."""
        if self.still is None:
            return None
        edges = np.flatnonzero(np.diff(np.concatenate(([0], self.still.astype(int), [0]))))
        lengths = (edges[1::2] - edges[::2]) / self.task.spec.record_hz
        return float(lengths[lengths >= DEADLOCK_S].sum())

    @property
    def smallest_distance(self) -> float | None:
        """Smallest distance of the body to an obstacle, see `clearance.smallest_distance`."""
        return None if self.states is None else smallest_distance(self.task, self.scenario, self.states)

    def to_json(self) -> dict[str, Any]:
        """The row of `eval.json`; measures that the task lacks are null."""
        forces = [None, None] if self.forces is None else [float(np.hypot(*force.T).mean()) for force in self.forces]
        return {
            **super().to_json(),
            "partner": self.partner,
            "robot_share": self.robot_share,
            "robot_force": forces[0],
            "partner_force": forces[1],
            "deadlock_s": self.deadlock_s,
            "partner_changes": self.partner_changes,
        }
