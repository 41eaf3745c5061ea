"""Commands of the players: the same set from any gamepad and from the keyboard."""

from dataclasses import dataclass
from enum import Enum, auto

from ..sdl import pygame
from .gamepads import Gamepads
from .keyboard import HALVES
from .mapping import UNKNOWN, GamepadMapping


class Command(Enum):
    """The commands that a player can give."""

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
    OTHER = auto()
    """A button without a command; like any button, it joins the session."""


Device = int | str
"""Instance id of a gamepad; `wasd`, `arrows` or `keyboard` for keys."""


@dataclass(frozen=True)
class Press:
    """One command and the device that gave it.

    Attributes:
        moved: given by moving a stick, not by a button; players also move a stick only to test it.
    """

    command: Command
    device: Device
    moved: bool = False


_CONTROLS = {
    "a": Command.ACCEPT,
    "b": Command.BACK,
    "x": Command.REDO,
    "y": Command.DISCARD,
    "leftshoulder": Command.NOTE,
    "rightshoulder": Command.UNDO,
    "back": Command.PAUSE,
    "start": Command.PAUSE,
    "dpup": Command.UP,
    "dpdown": Command.DOWN,
    "dpleft": Command.LEFT,
    "dpright": Command.RIGHT,
}
_KEYS_OF = {
    Command.UP: (pygame.K_UP, pygame.K_w),
    Command.DOWN: (pygame.K_DOWN, pygame.K_s),
    Command.LEFT: (pygame.K_LEFT, pygame.K_a),
    Command.RIGHT: (pygame.K_RIGHT, pygame.K_d),
    Command.ACCEPT: (pygame.K_RETURN, pygame.K_KP_ENTER, pygame.K_SPACE, pygame.K_e),
    Command.BACK: (pygame.K_BACKSPACE, pygame.K_q, pygame.K_RSHIFT),
    Command.PAUSE: (pygame.K_ESCAPE, pygame.K_p),
    Command.KEEP: (pygame.K_k,),
    Command.REDO: (pygame.K_r,),
    Command.DISCARD: (pygame.K_x,),
    Command.NOTE: (pygame.K_n,),
    Command.UNDO: (pygame.K_u,),
    Command.SWAP: (pygame.K_TAB,),
    Command.HELP: (pygame.K_F1, pygame.K_h),
}
_KEYS = {key: command for command, keys in _KEYS_OF.items() for key in keys}
_HALF_OF = {key: half.name for half in HALVES.values() for key in (*half.keys, half.accept_key, half.next_key)}
_PRESS, _RELEASE = 0.65, 0.35  # a stick gives a command beyond the first value, and the next one after the second


class CommandReader:
    """Turns events into presses; needs every event, to follow the sticks."""

    def __init__(self, gamepads: Gamepads | None = None):
        """
        Args:
            gamepads: give the mapping of each device; without them, all use the mapping of unknown devices.
        """
        self._gamepads = gamepads
        self._deflected: dict[tuple[int, int], bool] = {}

    def read(self, event: pygame.event.Event) -> Press | None:
        """Returns the press that an event stands for, or None."""
        if event.type == pygame.KEYDOWN and event.key in _KEYS:
            return Press(_KEYS[event.key], _HALF_OF.get(event.key, "keyboard"))
        if event.type == pygame.JOYBUTTONDOWN:
            control = self._mapping(event).control_of_button(event.button)
            return Press(_CONTROLS.get(control or "", Command.OTHER), event.instance_id)
        if event.type == pygame.JOYHATMOTION:
            x, y = event.value
            if not x and not y:
                return None
            direction = (1 if y > 0 else 4) if y else (2 if x > 0 else 8)
            control = self._mapping(event).control_of_hat(event.hat, direction)
            return Press(_CONTROLS.get(control, Command.OTHER), event.instance_id)
        if event.type == pygame.JOYAXISMOTION:
            return self._stick(event.instance_id, event.axis, event.value, self._mapping(event))
        return None

    def _mapping(self, event: pygame.event.Event) -> GamepadMapping:
        gamepad = self._gamepads.get(event.instance_id) if self._gamepads is not None else None
        return UNKNOWN if gamepad is None else gamepad.mapping

    def _stick(self, instance_id: int, axis: int, value: float, mapping: GamepadMapping) -> Press | None:
        axes, invert = mapping.stick("left") or mapping.dpad_axes or ((0, 1), (False, False))
        if axis not in axes:
            return None
        index = axes.index(axis)
        value = -value if invert[index] else value
        key = (instance_id, axis)
        if abs(value) < _RELEASE:
            self._deflected[key] = False
        elif abs(value) > _PRESS and not self._deflected.get(key):
            self._deflected[key] = True
            commands = ((Command.LEFT, Command.RIGHT), (Command.UP, Command.DOWN))[index]
            return Press(commands[value > 0], instance_id, moved=True)
        return None
