"""Scripted players of the peg: each pushes towards the mark and against the motion, from the state alone."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from copolicy.dataset.task import SimulatedPlayers

if TYPE_CHECKING:
    from .task import Line


@dataclass(frozen=True)
class Push:
    """Profile of a player: gain towards the mark, gain against the motion, and noise."""

    effort: float = 2.0  # full forces per m
    braking: float = 1.5  # full forces per m/s
    noise: float = 0.05


class Pusher:
    """A player of one episode; it never changes its strategy."""

    changes = 0

    def __init__(self, line: "Line", push: Push, seed: int):
        self._mark, self._push, self._rng = line.mark, push, np.random.default_rng(seed)

    def act(self, state: np.ndarray) -> np.ndarray:
        """Its force, `(1,)`."""
        position, velocity = state
        push = self._push
        force = push.effort * (self._mark - position) - push.braking * velocity + push.noise * self._rng.normal()
        return np.clip([force], -1.0, 1.0)


PAIRS = {"even": (Push(), Push()), "lazy": (Push(effort=3.0), Push(effort=1.0, braking=0.5))}
PARTNERS = {"helper": Push(), "hesitant": Push(effort=0.5, braking=2.0)}
ROBOTS = {"scripted": (Push(noise=0.0), "a usual simulated player without noise")}


def pair(line: "Line", name: str, seed: int) -> tuple[Pusher, Pusher]:
    """Both players of a pair, with separate random numbers."""
    robot, human = PAIRS[name]
    return Pusher(line, robot, 2 * seed), Pusher(line, human, 2 * seed + 1)


PLAYERS = SimulatedPlayers(
    PAIRS, PARTNERS, ROBOTS, pair,
    make_partner=lambda line, kind, seed: Pusher(line, PARTNERS[kind], seed),
    make_robot=lambda line, name, seed: Pusher(line, ROBOTS[name][0], seed),
)  # fmt: skip
