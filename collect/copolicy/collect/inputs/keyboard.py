"""Two players on one keyboard: each half has four keys for the force and two for the lobby."""

import math
from dataclasses import dataclass

from ..sdl import pygame
from .gamepads import InputSample


@dataclass(frozen=True)
class KeyboardHalf:
    """The keys of one player; pressed keys add up, which gives eight directions.

    Attributes:
        keys: left, right, up, down.
        accept_key: joins, and chooses an item of the lobby's menu.
        next_key: moves to the next item.
        hint: text for the screen.
    """

    name: str
    keys: tuple[int, int, int, int]
    accept_key: int
    next_key: int
    hint: str

    def sample(self, time_ns: int) -> InputSample:
        """Reads the keys as two axes and four buttons, as of the last pump of the event queue."""
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
"""The left and right half of the keyboard."""


def keyboard_force(sample: InputSample) -> tuple[float, float]:
    """Returns the force `(x, y)` of a keyboard half: of size 1 in each of the eight directions, or 0."""
    x, y = sample.axes
    size = math.hypot(x, y)
    return (x / size, y / size) if size > 1 else (x, y)
