"""Two players on one keyboard: each half has four keys for the force, and two for the lobby."""

import math
from dataclasses import dataclass

from ..sdl import pygame
from .joysticks import InputSample


@dataclass(frozen=True)
class KeyboardHalf:
    """Keys of one player; several at once add up, so that any direction of eight is possible.

    Attributes:
        keys: left, right, up, down.
        accept: joins, and chooses in the lobby.
        following: moves on in the lobby.
    """

    name: str
    keys: tuple[int, int, int, int]
    accept: int
    following: int
    hint: str

    def sample(self, time_ns: int) -> InputSample:
        """The keys as two axes and four buttons, as of the last pump of the event queue."""
        pressed = pygame.key.get_pressed()
        left, right, up, down = (bool(pressed[key]) for key in self.keys)
        return InputSample((float(right - left), float(down - up)), (left, right, up, down), time_ns)


HALVES = {
    "wasd": KeyboardHalf(
        "wasd", (pygame.K_a, pygame.K_d, pygame.K_w, pygame.K_s), pygame.K_e, pygame.K_q, "W A S D, with E and Q"
    ),
    "arrows": KeyboardHalf(
        "arrows",
        (pygame.K_LEFT, pygame.K_RIGHT, pygame.K_UP, pygame.K_DOWN),
        pygame.K_RETURN,
        pygame.K_RSHIFT,
        "arrow keys, with Enter and right Shift",
    ),
}
"""Left and right half of the keyboard."""


def keyboard_force(sample: InputSample) -> tuple[float, float]:
    """The force of a half: full in the direction of its keys, the diagonals no stronger than the rest."""
    x, y = sample.axes
    size = math.hypot(x, y)
    return (x / size, y / size) if size > 1 else (x, y)
