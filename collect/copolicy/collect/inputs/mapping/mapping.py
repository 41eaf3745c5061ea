"""The mapping of one gamepad from buttons, axes and hats to controls, in SDL's names and format."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from copolicy.dataset.exceptions import InvalidValueError

DPAD = ("dpleft", "dpright", "dpup", "dpdown")
"""The four directions of the d-pad."""

_STICK_HALVES = ("-leftx", "+leftx", "-lefty", "+lefty")
_NAME = re.compile(r"[+-]?[a-z][a-z0-9]*")
# SDL appends a `crc` entry; if the line lacks a final comma, pygame 2.6 returns it as part of the last binding.
_BINDING = re.compile(r"([+-]?)([abh])(\d+)(?:\.([1248]))?(~?)(?:crc)?")
_METADATA = ("crc", "hint", "platform", "sdk>", "sdk<", "type", "face")  # entries of a line that bind no control


@dataclass(frozen=True)
class Binding:
    """A button, an axis, half of an axis, or a direction of a hat.

    Attributes:
        kind: `b` for a button, `a` for an axis, `h` for a hat.
        part: `+` or `-` for half of an axis.
        direction: of a hat, SDL's bit: 1 up, 2 right, 4 down, 8 left.
        inverted: the axis is reversed.
    """

    kind: Literal["a", "b", "h"]
    index: int
    part: str = ""
    direction: int = 0
    inverted: bool = False

    @classmethod
    def parse(cls, text: str) -> "Binding":
        """Reads `b3`, `a0`, `a1~`, `+a2` or `h0.4`.

        Raises:
            InvalidValueError: another form.
        """
        match = _BINDING.fullmatch(text)
        if match is None or (match[2] == "h") != bool(match[4]) or ((match[1] or match[5]) and match[2] != "a"):
            raise InvalidValueError("binding", "a button b0, an axis a0, or a direction of a hat h0.1", text)
        kind: Literal["a", "b", "h"] = match[2]  # pyright: ignore[reportAssignmentType]
        return cls(kind, int(match[3]), match[1], int(match[4] or 0), bool(match[5]))

    def __str__(self) -> str:
        direction = f".{self.direction}" if self.kind == "h" else ""
        return f"{self.part}{self.kind}{self.index}{direction}{'~' * self.inverted}"


@dataclass(frozen=True)
class GamepadMapping:
    """The bindings of a device's controls, by SDL's control names.

    `a`, `b`, `x`, `y` are the lower, right, left and upper button (on Nintendo gamepads, those with these letters);
    others are `back`, `start`, `leftshoulder`, `rightshoulder`, `dpup`, ..., `leftx`, `lefty`.

    Attributes:
        name: of the device; selects the printed labels.
        source: SDL's list, the user, or a guess.
    """

    name: str
    bindings: Mapping[str, Binding]
    source: Literal["sdl", "user", "guess"] = "sdl"
    _buttons: dict[int, str] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        buttons = {binding.index: control for control, binding in self.bindings.items() if binding.kind == "b"}
        object.__setattr__(self, "_buttons", buttons)

    @property
    def is_known(self) -> bool:
        """The mapping is SDL's or the user's, not a guess."""
        return self.source != "guess"

    @classmethod
    def parse(
        cls, name: str, entries: Mapping[str, str], source: Literal["sdl", "user", "guess"] = "sdl"
    ) -> "GamepadMapping":
        """Reads the entries of an SDL line, control to binding.

        Raises:
            InvalidValueError: an entry has an invalid control name or binding.
        """
        bindings = {}
        for control, text in entries.items():
            if control in _METADATA or control.startswith("sdk"):
                continue
            if not _NAME.fullmatch(control):
                raise InvalidValueError("control", "a name of SDL's, such as leftx", control)
            bindings[control] = Binding.parse(text)
        return cls(name, bindings, source)

    def line(self, guid: str) -> str:
        """Returns the mapping as a line of SDL's `gamecontrollerdb.txt`."""
        name = self.name.replace(",", " ")
        return ",".join([guid, name, *(f"{control}:{binding}" for control, binding in self.bindings.items())]) + ","

    def control_of_button(self, index: int) -> str | None:
        """Returns the control of a button, or None."""
        return self._buttons.get(index)

    def control_of_hat(self, index: int, direction: int) -> str:
        """Returns the control of a hat's direction; a hat without bindings is taken as the d-pad."""
        for control, binding in self.bindings.items():
            if binding.kind == "h" and (binding.index, binding.direction) == (index, direction):
                return control
        return {1: "dpup", 2: "dpright", 4: "dpdown", 8: "dpleft"}[direction]

    def stick(self, side: str) -> tuple[tuple[int, int], tuple[bool, bool]] | None:
        """Returns the x, y axes of the `left` or `right` stick and whether each is reversed; None without a stick."""
        x, y = (self.bindings.get(side + axis) for axis in "xy")
        if x is None or y is None or x.kind != "a" or y.kind != "a" or x.part or y.part:
            return None
        return (x.index, y.index), (x.inverted, y.inverted)

    @property
    def dpad_axes(self) -> tuple[tuple[int, int], tuple[bool, bool]] | None:
        """The x, y axes of a d-pad that the device reports as axes, and whether each is reversed; else None."""
        left, right, up, down = self._dpad
        if left is None or right is None or up is None or down is None:
            return None
        if any(binding.kind != "a" or not binding.part for binding in (left, right, up, down)):
            return None
        return (right.index, down.index), (right.part == "-", down.part == "-")

    @property
    def dpad_buttons(self) -> tuple[int, int, int, int] | None:
        """The left, right, up and down button of the d-pad; None if it is not reported as buttons."""
        buttons = [binding.index for binding in self._dpad if binding is not None and binding.kind == "b"]
        return (buttons[0], buttons[1], buttons[2], buttons[3]) if len(buttons) == 4 else None

    @property
    def _dpad(self) -> tuple[Binding | None, ...]:
        for names in (DPAD, _STICK_HALVES):
            bindings = tuple(self.bindings.get(name) for name in names)
            if all(bindings):
                return bindings
        return (None,) * 4


UNKNOWN = GamepadMapping.parse(
    "", {"a": "b0", "b": "b1", "x": "b2", "y": "b3", "leftx": "a0", "lefty": "a1"}, source="guess"
)
"""For a device without a mapping of SDL or the user. No button pauses, since any number may be a trigger."""
