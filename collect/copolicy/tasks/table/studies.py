"""Definitions and limits of studies with the table."""

import math
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.task import PublishedFigures, Studies, TrajectoryFigures

from .features import theta_of
from .interaction import interaction_force
from .map_config import MapConfig
from .maps import ORIENTATIONS, start_at
from .published import PEOPLE_SOURCE, PUBLISHED, SOURCE

_STILL_SPEED, _STILL_SPIN = 6.0, 0.1  # px/s, rad/s


def _mirrored_interaction(states: Array, actions: Array) -> Array:
    return interaction_force(theta_of(states), actions, legacy_axis=True)


# The program stores (F_robot - F_human) . e with forces of 50 at full force, which is 100 times our half difference of
# unit forces; its figure code divides by 101. Demonstrations keep unit forces, which is 2 times our value.
_PUBLISHED_FIGURES = PublishedFigures(
    source="the figure code released with the paper (June 2023)",
    mirrored_interaction=_mirrored_interaction,
    study_scale=100.0,
    demonstration_scale=2.0,
    bins=(25.0, 50.0, 70.0),
    colour_limit=101.0,
    visit_limits=(0.01, 800.0),
    visit_exponent=0.45,
    obstacle_side=45.0,
)


class TableStudies(Studies):
    """See `Studies`; the step limit is the paper's."""

    step_limit = 2000
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

    # The paper's .25 and .75 are proportions of 101 of the program's unit: |f_unit| of 0.5 and 1.5, where f_unit is the
    # difference of unit forces along the table. Our measure is half of f_unit.
    figures = TrajectoryFigures(
        visit_cell=12.0,
        interaction_cell=50.0,
        thresholds=(0.25, 0.75),
        thresholds_source="the paper's .25 and .75 (differences of 0.5 and 1.5 between unit forces along the table, "
        "of which our measure is half)",
        published=_PUBLISHED_FIGURES,
    )
    published = PUBLISHED
    published_source = SOURCE
    published_people_source = PEOPLE_SOURCE
    fronts = ("human_front", "robot_front")

    def front(self, scenario: MapConfig) -> str:
        """Whose end of the table points to the goal, within 45 degrees; empty if the table lies across."""
        ahead = _robot_ahead(scenario)
        if abs(ahead) < math.cos(math.pi / 4) - 1e-9:  # at 45 degrees, rounding must not decide
            return ""
        return "robot_front" if ahead > 0 else "human_front"

    def with_front(self, scenario: MapConfig, front: str) -> MapConfig:
        """The map in that of the four start orientations in which the end points to the goal best."""
        sign = 1 if front == "robot_front" else -1
        turned = [start_at(scenario, theta) for theta in ORIENTATIONS]
        return max(turned, key=lambda config: sign * _robot_ahead(config))

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


def _robot_ahead(config: MapConfig) -> float:
    """Cosine of the angle between the direction from the table's centre to the robot's end and that to the goal."""
    x, y, theta = config.start
    dx, dy = config.goal[0] - x, config.goal[1] - y
    return (math.cos(theta) * dx - math.sin(theta) * dy) / (math.hypot(dx, dy) or 1.0)
