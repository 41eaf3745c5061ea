"""Scripted players by name: of simulated pairs, of kinds of partner, and for the robot's seat of a study."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.task import SimulatedPlayers
from copolicy.dataset.task_spec import RECORD_HZ

from ..map_config import MapConfig
from .partner_pairs import PARTNER_PAIRS
from .profiles import PAIRS, PARTNERS, ROBOTS, PlayerProfile

if TYPE_CHECKING:
    from .scripted_player import ScriptedPlayer


ALL_PAIRS = {**PAIRS, **PARTNER_PAIRS}


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
    robot, human = _lookup("simulated pair", pair_id, seed, ALL_PAIRS)
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


def human_like_player(map_config: MapConfig, seed: int, delay_s: float) -> "ScriptedPlayer":
    """A player of the usual profile at the human's seat with a reaction delay, without additive noise.

    Its pulses, drift of effort, pauses and slips remain; the caller adds noise that depends on the force.
    """
    if seed < 0:
        raise InvalidValueError("seed", "a whole number, not negative", seed)
    profile = PlayerProfile(delay_steps=round(delay_s * RECORD_HZ), noise=0.0)
    own_seed = np.random.SeedSequence([seed, *b"human-like"]).generate_state(1, np.uint64)[0]
    return _player(1, map_config, profile, int(own_seed))


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
    ALL_PAIRS,
    PARTNERS,
    ROBOTS,
    simulated_pair,
    simulated_partner,
    scripted_robot,
    options=("clearance",),
    default_pairs=tuple(PAIRS),
    make_human_like=human_like_player,
)
"""The scripted players of the task, `TableTask.agents`."""
