"""What is measured of one episode with a partner."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from copolicy.dataset.task_spec import RECORD_HZ

from ..coplan.rollouts import Outcome

STILL_SPEED = 6.0
"""px/s below which, and ..."""
STILL_SPIN = 0.1
"""... rad/s below which the table stands."""
DEADLOCK_S = 1.0
"""A table that stands for so long on end, while the episode runs, is in a deadlock."""


def stands(states: np.ndarray) -> np.ndarray:
    """`(T,)` whether the table stands in recorded states `(T, 6)`."""
    vx, vy, omega = states[:, 3:].T
    return (vx * vx + vy * vy < STILL_SPEED**2) & (np.abs(omega) < STILL_SPIN)


@dataclass(frozen=True)
class PartnerOutcome(Outcome):
    """One episode of a robot with a simulated partner.

    Attributes:
        partner: kind of the partner.
        actions: `(steps, 4)` robot xy, human xy, as executed.
        still: `(steps,)` whether the table stood after each step.
        partner_changes: how often the partner changed its mind about the route.
    """

    partner: str
    actions: np.ndarray
    still: np.ndarray
    partner_changes: int

    @property
    def work(self) -> tuple[float, float]:
        """Positive work of robot and partner on the table's centre, full forces x px; turning it takes under 1 %."""
        way = np.diff(self.path, axis=0)
        power = (np.einsum("ti,ti->t", self.actions[:, :2], way), np.einsum("ti,ti->t", self.actions[:, 2:], way))
        return float(power[0].clip(0).sum()), float(power[1].clip(0).sum())

    @property
    def robot_share(self) -> float:
        """Robot's share of the positive work of both: 0.5 where they share it, 0 where the robot does nothing."""
        robot, partner = self.work
        return robot / (robot + partner) if robot + partner > 0 else 0.0

    @property
    def deadlock_s(self) -> float:
        """Time in stand-stills of at least `DEADLOCK_S`, s."""
        edges = np.flatnonzero(np.diff(np.concatenate(([0], self.still.astype(int), [0]))))
        lengths = (edges[1::2] - edges[::2]) / RECORD_HZ
        return float(lengths[lengths >= DEADLOCK_S].sum())

    def to_json(self) -> dict[str, Any]:
        """The row of `eval.json`."""
        return {
            **super().to_json(),
            "partner": self.partner,
            "robot_share": self.robot_share,
            "robot_force": float(np.hypot(*self.actions[:, :2].T).mean()),
            "partner_force": float(np.hypot(*self.actions[:, 2:].T).mean()),
            "deadlock_s": self.deadlock_s,
            "partner_changes": self.partner_changes,
        }
