"""Simulated players of the five pairs, of the kinds of partner, and at the robot seat of a study."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.task import SimulatedPlayers

from ..map_config import MapConfig
from .profiles import PAIRS, PARTNERS, ROBOTS, Habits

if TYPE_CHECKING:
    from .scripted import ScriptedPilot


def simulated_pair(
    map_config: MapConfig, pair_id: str, seed: int, clearance: float | None = None
) -> tuple["ScriptedPilot", "ScriptedPilot"]:
    """Two pilots with the habits of a pair and separate random numbers: (robot seat, human seat).

    Args:
        clearance: how wide both keep from obstacles, instead of their habits' own.

    Raises:
        InvalidValueError: a negative seed.
        UnknownNameError: no such pair.
    """
    robot, human = _profile("simulated pair", pair_id, seed, PAIRS)
    if clearance is not None:
        robot, human = replace(robot, clearance=clearance), replace(human, clearance=clearance)
    streams = np.random.SeedSequence([seed, *pair_id.encode()]).generate_state(2, np.uint64)
    return (
        _pilot(0, map_config, robot, int(streams[0])),
        _pilot(1, map_config, human, int(streams[1])),
    )


def simulated_partner(map_config: MapConfig, kind: str, seed: int, player: int = 1) -> "ScriptedPilot":
    """A partner of a kind, by default at the human seat; equal seeds want the same route, whoever the other is.

    Raises:
        InvalidValueError: a negative seed or no such seat.
        UnknownNameError: no such kind.
    """
    habits = _profile("kind of partner", kind, seed, PARTNERS)
    stream = np.random.SeedSequence([seed, *kind.encode()]).generate_state(1, np.uint64)[0]
    return _pilot(player, map_config, habits, int(stream))


def scripted_robot(map_config: MapConfig, name: str, seed: int) -> "ScriptedPilot":
    """A scripted player for the robot seat of a study.

    Raises:
        InvalidValueError: a negative seed.
        UnknownNameError: no such robot.
    """
    habits, _ = _profile("scripted robot", name, seed, ROBOTS)
    return _pilot(0, map_config, habits, seed)


def _profile[T](what: str, name: str, seed: int, profiles: Mapping[str, T]) -> T:
    if name not in profiles:
        raise UnknownNameError(what, name, profiles)
    if seed < 0:
        raise InvalidValueError("seed", "a whole number, not negative", seed)
    return profiles[name]


def _pilot(player: int, map_config: MapConfig, habits: Habits, seed: int) -> "ScriptedPilot":
    from .scripted import ScriptedPilot  # scipy, which flags that list names should not wait for

    return ScriptedPilot(player, map_config, habits, seed)


PLAYERS = SimulatedPlayers(
    PAIRS, PARTNERS, ROBOTS, simulated_pair, simulated_partner, scripted_robot, options=("clearance",)
)
"""The task's part `agents`."""
