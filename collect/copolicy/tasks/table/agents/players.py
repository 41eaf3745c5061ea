"""Scripted players by name: of simulated pairs, of kinds of partner, and for the robot's seat of a study."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.task import SimulatedPlayers

from ..map_config import MapConfig
from .profiles import PAIRS, PARTNERS, ROBOTS, PlayerProfile

if TYPE_CHECKING:
    from .scripted_player import ScriptedPlayer


def simulated_pair(
    map_config: MapConfig, pair_id: str, seed: int, clearance: float | None = None
) -> tuple["ScriptedPlayer", "ScriptedPlayer"]:
    """Two players with the profiles of a pair and separate random numbers: (robot's seat, human's seat).

    Args:
        clearance: replaces `PlayerProfile.clearance` of both.

    Raises:
        InvalidValueError: a negative seed.
        UnknownNameError: no such pair.
    """
    robot, human = _lookup("simulated pair", pair_id, seed, PAIRS)
    if clearance is not None:
        robot, human = replace(robot, clearance=clearance), replace(human, clearance=clearance)
    seeds = np.random.SeedSequence([seed, *pair_id.encode()]).generate_state(2, np.uint64)
    return _player(0, map_config, robot, int(seeds[0])), _player(1, map_config, human, int(seeds[1]))


def simulated_partner(map_config: MapConfig, kind: str, seed: int, player: int = 1) -> "ScriptedPlayer":
    """A partner of a kind, by default at the human's seat; equal seeds start on the same route against any robot.

    Raises:
        InvalidValueError: a negative seed or no such seat.
        UnknownNameError: no such kind.
    """
    profile = _lookup("kind of partner", kind, seed, PARTNERS)
    own_seed = np.random.SeedSequence([seed, *kind.encode()]).generate_state(1, np.uint64)[0]
    return _player(player, map_config, profile, int(own_seed))


def scripted_robot(map_config: MapConfig, name: str, seed: int) -> "ScriptedPlayer":
    """A scripted player for the robot's seat of a study.

    Raises:
        InvalidValueError: a negative seed.
        UnknownNameError: no such robot.
    """
    profile, _ = _lookup("scripted robot", name, seed, ROBOTS)
    return _player(0, map_config, profile, seed)


def _lookup[T](label: str, name: str, seed: int, profiles: Mapping[str, T]) -> T:
    if name not in profiles:
        raise UnknownNameError(label, name, profiles)
    if seed < 0:
        raise InvalidValueError("seed", "a whole number, not negative", seed)
    return profiles[name]


def _player(player: int, map_config: MapConfig, profile: PlayerProfile, seed: int) -> "ScriptedPlayer":
    from .scripted_player import ScriptedPlayer  # scipy, which flags that list names do not need

    return ScriptedPlayer(player, map_config, profile, seed)


SCRIPTED_PLAYERS = SimulatedPlayers(
    PAIRS, PARTNERS, ROBOTS, simulated_pair, simulated_partner, scripted_robot, options=("clearance",)
)
"""The scripted players of the task, `TableTask.agents`."""
