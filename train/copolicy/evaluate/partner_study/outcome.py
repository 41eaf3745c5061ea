"""What is measured of one episode with a partner."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..coplan.rollouts import Outcome

DEADLOCK_S = 1.0
"""What stands for so long on end, while the episode runs, is in a deadlock."""


@dataclass(frozen=True)
class PartnerOutcome(Outcome):
    """One episode of a robot with a simulated partner.

    Attributes:
        partner: kind of the partner.
        actions: `(steps, 2 m)` joint actions, robot first, as executed.
        still: `(steps,)` whether what is moved stood after each step; None: the task does not tell.
        partner_changes: how often the partner changed its mind.
    """

    partner: str
    actions: np.ndarray
    still: np.ndarray | None
    partner_changes: int

    @cached_property
    def forces(self) -> tuple[np.ndarray, np.ndarray] | None:
        """`(steps, 2)` of robot and partner, full forces; None where the task has no outline, which tells them."""
        if self.task.outline is None:
            return None
        both = self.task.outline.forces(self.actions)
        return both[:, :2], both[:, 2:]

    @property
    def work(self) -> tuple[float, float] | None:
        """Positive work of robot and partner on the point that is followed, full forces x its unit; else None.

        What turns the table is left out: it takes under 1 %.
        """
        if self.forces is None or self.path is None:
            return None
        way = np.diff(self.path, axis=0)
        robot, partner = (float(np.einsum("ti,ti->t", force, way).clip(0).sum()) for force in self.forces)
        return robot, partner

    @property
    def robot_share(self) -> float | None:
        """Robot's share of the positive work of both: 0.5 where they share it, 0 where the robot does nothing."""
        if self.work is None:
            return None
        robot, partner = self.work
        return robot / (robot + partner) if robot + partner > 0 else 0.0

    @property
    def deadlock_s(self) -> float | None:
        """Time in stand-stills of at least `DEADLOCK_S`, s."""
        if self.still is None:
            return None
        edges = np.flatnonzero(np.diff(np.concatenate(([0], self.still.astype(int), [0]))))
        lengths = (edges[1::2] - edges[::2]) / self.task.spec.record_hz
        return float(lengths[lengths >= DEADLOCK_S].sum())

    def to_json(self) -> dict[str, Any]:
        """The row of `eval.json`; null where the task does not tell."""
        forces = [None, None] if self.forces is None else [float(np.hypot(*one.T).mean()) for one in self.forces]
        return {
            **super().to_json(),
            "partner": self.partner,
            "robot_share": self.robot_share,
            "robot_force": forces[0],
            "partner_force": forces[1],
            "deadlock_s": self.deadlock_s,
            "partner_changes": self.partner_changes,
        }
