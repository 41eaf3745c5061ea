"""Pilots of the five simulated pairs."""

from dataclasses import replace

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError

from ..map_config import MapConfig
from .pair_habits import PAIRS
from .scripted import ScriptedPilot


def simulated_pair(
    map_config: MapConfig, pair_id: str, seed: int, clearance: float | None = None
) -> tuple[ScriptedPilot, ScriptedPilot]:
    """Two pilots with the habits of a pair and separate random numbers: (robot seat, human seat).

    Args:
        clearance: how wide both keep from obstacles, instead of their habits' own.

    Raises:
        InvalidValueError: a negative seed.
        UnknownNameError: no such pair.
    """
    if pair_id not in PAIRS:
        raise UnknownNameError("simulated pair", pair_id, PAIRS)
    if seed < 0:
        raise InvalidValueError("seed", "a whole number, not negative", seed)
    robot, human = PAIRS[pair_id]
    if clearance is not None:
        robot, human = replace(robot, clearance=clearance), replace(human, clearance=clearance)
    streams = np.random.SeedSequence([seed, *pair_id.encode()]).generate_state(2, np.uint64)
    return (
        ScriptedPilot(0, map_config, robot, int(streams[0])),
        ScriptedPilot(1, map_config, human, int(streams[1])),
    )
