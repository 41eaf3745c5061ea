"""The mapping of one gamepad: which button, axis or hat is which control, in the words of SDL."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from copolicy.dataset.exceptions import InvalidValueError

CROSS = ("dpleft", "dpright", "dpup", "dpdown")
"""The four directions of the d-pad."""

_STICK_HALVES = ("-leftx", "+leftx", "-lefty", "+lefty")
_NAME = re.compile(r"[+-]?[a-z][a-z0-9]*")
# pygame 2.6 glues the entry that SDL appends to the last one of a line without a comma at its end.
_BINDING = re.compile(r"([+-]?)([abh])(\d+)(?:\.([1248]))?(~?)(?:crc)?")
_ABOUT = ("crc", "hint", "platform", "sdk>", "sdk<", "type", "face")  # entries of a line that bind nothing


@dataclass(frozen=True)
class Binding:
    """A button, an axis, half of an axis, or a direction of a hat.

    Attributes:
        part: `+` or `-` for half of an axis.
        direction: of a hat, SDL's bit: 1 up, 2 right, 4 down, 8 left.
        inverted: the axis is turned round.
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
        found = _BINDING.fullmatch(text)
        if found is None or (found[2] == "h") != bool(found[4]) or ((found[1] or found[5]) and found[2] != "a"):
            raise InvalidValueError("binding", "a button b0, an axis a0, or a direction of a hat h0.1", text)
        kind: Literal["a", "b", "h"] = found[2]  # pyright: ignore[reportAssignmentType]
        return cls(kind, int(found[3]), found[1], int(found[4] or 0), bool(found[5]))

    def __str__(self) -> str:
        direction = f".{self.direction}" if self.kind == "h" else ""
        return f"{self.part}{self.kind}{self.index}{direction}{'~' * self.inverted}"


@dataclass(frozen=True)
class GamepadMapping:
    """What each button and axis of a device means, by SDL's names of controls.

    `a`, `b`, `x`, `y` are the lower, right, left and upper button (on Nintendo's pads, those with these letters), then
    `back`, `start`, `leftshoulder`, `rightshoulder`, `dpup`, ..., `leftx`, `lefty` and so on.

    Attributes:
        name: of the device; what is printed on it follows from it.
        source: who said so: SDL's list, the user, or nobody.
    """

    name: str
    bindings: Mapping[str, Binding]
    source: Literal["sdl", "user", "guess"] = "sdl"
    _buttons: dict[int, str] = field(init=False, repr=False, compare=False)

    def __post_init__(self):
        buttons = {one.index: control for control, one in self.bindings.items() if one.kind == "b"}
        object.__setattr__(self, "_buttons", buttons)

    @property
    def known(self) -> bool:
        """It is no guess."""
        return self.source != "guess"

    @classmethod
    def parse(
        cls, name: str, entries: Mapping[str, str], source: Literal["sdl", "user", "guess"] = "sdl"
    ) -> "GamepadMapping":
        """Reads the entries of SDL's line, control to binding.

        Raises:
            InvalidValueError: an entry binds a control to something that is none.
        """
        bindings = {}
        for control, text in entries.items():
            if control in _ABOUT or control.startswith("sdk"):
                continue
            if not _NAME.fullmatch(control):
                raise InvalidValueError("control", "a name of SDL's, such as leftx", control)
            bindings[control] = Binding.parse(text)
        return cls(name, bindings, source)

    def line(self, guid: str) -> str:
        """The line of SDL's `gamecontrollerdb.txt`."""
        name = self.name.replace(",", " ")
        return ",".join([guid, name, *(f"{control}:{one}" for control, one in self.bindings.items())]) + ","

    def of_button(self, index: int) -> str | None:
        """The control behind a button."""
        return self._buttons.get(index)

    def of_hat(self, index: int, direction: int) -> str:
        """The control behind a direction of a hat; a hat that nobody described is a d-pad."""
        for control, one in self.bindings.items():
            if one.kind == "h" and (one.index, one.direction) == (index, direction):
                return control
        return {1: "dpup", 2: "dpright", 4: "dpdown", 8: "dpleft"}[direction]

    def stick(self, side: str) -> tuple[tuple[int, int], tuple[bool, bool]] | None:
        """Axes of the `left` or `right` stick and whether they are turned round; None where it has none."""
        x, y = (self.bindings.get(side + axis) for axis in "xy")
        if x is None or y is None or x.kind != "a" or y.kind != "a" or x.part or y.part:
            return None
        return (x.index, y.index), (x.inverted, y.inverted)

    @property
    def cross_axes(self) -> tuple[tuple[int, int], tuple[bool, bool]] | None:
        """The d-pad, where the device reports it as two axes."""
        left, right, up, down = self._cross
        if left is None or right is None or up is None or down is None:
            return None
        if any(one.kind != "a" or not one.part for one in (left, right, up, down)):
            return None
        return (right.index, down.index), (right.part == "-", down.part == "-")

    @property
    def cross_buttons(self) -> tuple[int, int, int, int] | None:
        """Buttons of the d-pad: left, right, up, down; None where it is no buttons."""
        numbers = [one.index for one in self._cross if one is not None and one.kind == "b"]
        return (numbers[0], numbers[1], numbers[2], numbers[3]) if len(numbers) == 4 else None

    @property
    def _cross(self) -> tuple[Binding | None, ...]:
        for names in (CROSS, _STICK_HALVES):
            found = tuple(self.bindings.get(name) for name in names)
            if all(found):
                return found
        return (None,) * 4


UNKNOWN = GamepadMapping.parse(
    "", {"a": "b0", "b": "b1", "x": "b2", "y": "b3", "leftx": "a0", "lefty": "a1"}, source="guess"
)
"""For a device that neither SDL nor the user described. Nothing pauses there: a trigger may have any number."""
