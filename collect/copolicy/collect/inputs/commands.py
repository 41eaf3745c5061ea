"""What a press means: the same few commands from any joystick and from the keyboard."""

from dataclasses import dataclass
from enum import Enum, auto

from ..sdl import pygame
from .keyboard import HALVES


class Command(Enum):
    """What a player can ask for, wherever it comes from."""

    UP = auto()
    DOWN = auto()
    LEFT = auto()
    RIGHT = auto()
    ACCEPT = auto()
    BACK = auto()
    PAUSE = auto()
    KEEP = auto()
    REDO = auto()
    DISCARD = auto()
    NOTE = auto()
    UNDO = auto()
    SWAP = auto()
    HELP = auto()


Device = int | str
"""Instance id of a joystick; `wasd`, `arrows` or `keyboard` for keys."""


@dataclass(frozen=True)
class Press:
    """One command and where it came from.

    Attributes:
        moved: it is a stick's deflection, not a button: a stick is also moved to try it.
    """

    command: Command
    device: Device
    moved: bool = False


# The order of SDL's own mapping of game pads, which most drivers of plain joysticks share for the first four.
_BUTTONS = {
    0: Command.ACCEPT,
    1: Command.BACK,
    2: Command.REDO,
    3: Command.DISCARD,
    4: Command.NOTE,
    5: Command.UNDO,
    6: Command.PAUSE,
    7: Command.PAUSE,
    9: Command.PAUSE,
    11: Command.UP,
    12: Command.DOWN,
    13: Command.LEFT,
    14: Command.RIGHT,
}
_KEYS = {
    pygame.K_UP: Command.UP,
    pygame.K_DOWN: Command.DOWN,
    pygame.K_LEFT: Command.LEFT,
    pygame.K_RIGHT: Command.RIGHT,
    pygame.K_w: Command.UP,
    pygame.K_s: Command.DOWN,
    pygame.K_a: Command.LEFT,
    pygame.K_d: Command.RIGHT,
    pygame.K_RETURN: Command.ACCEPT,
    pygame.K_KP_ENTER: Command.ACCEPT,
    pygame.K_SPACE: Command.ACCEPT,
    pygame.K_e: Command.ACCEPT,
    pygame.K_ESCAPE: Command.PAUSE,
    pygame.K_p: Command.PAUSE,
    pygame.K_BACKSPACE: Command.BACK,
    pygame.K_q: Command.BACK,
    pygame.K_RSHIFT: Command.BACK,
    pygame.K_k: Command.KEEP,
    pygame.K_r: Command.REDO,
    pygame.K_x: Command.DISCARD,
    pygame.K_n: Command.NOTE,
    pygame.K_u: Command.UNDO,
    pygame.K_TAB: Command.SWAP,
    pygame.K_F1: Command.HELP,
    pygame.K_h: Command.HELP,
}
_HALF_OF = {key: half.name for half in HALVES.values() for key in (*half.keys, half.accept, half.following)}
_TIPPED, _LEVEL = 0.65, 0.35  # a stick gives one command when it passes the first, the next after it passed the second


class CommandReader:
    """Turns events into presses; sees every event, for the edges of sticks."""

    def __init__(self):
        self._tipped: dict[tuple[int, int], bool] = {}

    def read(self, event: pygame.event.Event) -> Press | None:
        """The press behind an event, if there is one."""
        if event.type == pygame.KEYDOWN and event.key in _KEYS:
            return Press(_KEYS[event.key], _HALF_OF.get(event.key, "keyboard"))
        if event.type == pygame.JOYBUTTONDOWN and event.button in _BUTTONS:
            return Press(_BUTTONS[event.button], event.instance_id)
        if event.type == pygame.JOYHATMOTION:
            x, y = event.value
            if y:
                return Press(Command.UP if y > 0 else Command.DOWN, event.instance_id)
            if x:
                return Press(Command.RIGHT if x > 0 else Command.LEFT, event.instance_id)
        if event.type == pygame.JOYAXISMOTION and event.axis < 2:
            return self._stick(event.instance_id, event.axis, event.value)
        return None

    def _stick(self, instance_id: int, axis: int, value: float) -> Press | None:
        key = (instance_id, axis)
        if abs(value) < _LEVEL:
            self._tipped[key] = False
        elif abs(value) > _TIPPED and not self._tipped.get(key):
            self._tipped[key] = True
            commands = ((Command.LEFT, Command.RIGHT), (Command.UP, Command.DOWN))[axis]
            return Press(commands[value > 0], instance_id, moved=True)
        return None
