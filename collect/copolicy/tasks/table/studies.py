"""Definitions and limits of studies with the table."""

from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.task import Studies

from .map_config import MapConfig
from .published import PUBLISHED, SOURCE

_STILL_SPEED, _STILL_SPIN = 6.0, 0.1  # px/s, rad/s


class TableStudies(Studies):
    """See `Studies`; the step limit is the paper's."""

    step_limit = 2000
    dissent = (0.25, 0.75)  # the paper's thresholds: |(u_robot - u_human) . e| of 0.5 and 1.5 full forces
    near_miss = 10.0  # px; an obstacle is 50 px wide, and 5 % of the simulated pairs' episodes come below 33 px
    definitions = {  # noqa: RUF012 (read only, as the base says)
        "success": "touch the goal",
        "interaction_force": "|(u_robot - u_partner) . e| / 2 along the table, full forces",
        "human_interaction_force": "|(u_robot - u_human) . e| / 2, full forces",
        "work": "the table's centre",
        "at_rest": f"below {_STILL_SPEED:g} px/s and {_STILL_SPIN:g} rad/s",
        "change": "its route",
        "partners": "scripted agents that choose their own route act at the human's seat, no person took part; they "
        "know every route of the map, which favours any robot",
    }

    published = PUBLISHED
    published_source = SOURCE

    def factors(self, scenario: MapConfig) -> dict[str, Any]:
        """Start orientation (rad) and number of obstacles of a map."""
        return {"start_theta": scenario.start[2], "obstacles": len(scenario.obstacles)}

    def at_rest(self, recorded: Array) -> Array:
        """`(T,)` whether speed and spin of the table are below the limits."""
        vx, vy, omega = recorded[:, 3:].T
        return (vx * vx + vy * vy < _STILL_SPEED**2) & (np.abs(omega) < _STILL_SPIN)

    def strategy_actions(self, scenario: MapConfig, states: Array) -> tuple[tuple[str, ...], Array]:
        """See `route_forces`."""
        from .agents.route_forces import route_forces  # scipy

        return route_forces(scenario, states)
