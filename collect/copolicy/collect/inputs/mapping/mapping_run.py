"""The set-up of a gamepad that SDL does not know: the player presses each control when prompted."""

from ...sdl import pygame
from .mapping import Binding, GamepadMapping

_MIN_MOVE = 0.5  # axis units from its value at rest, since a trigger may rest at its end

_BUTTONS = {
    "a": "choose and start",
    "b": "back",
    "start": "pause",
    "x": "redo",
    "y": "discard",
    "leftshoulder": "add a note",
    "rightshoulder": "undo",
}
_REQUIRED = ("a", "b")  # the lobby's menu needs these two
_STEER = {
    "dpright": "push the stick or d-pad that steers to the right",
    "dpdown": "now push it down, towards you",
    "dpleft": "now to the left",
    "dpup": "now up, away from you",
}


class MappingRun:
    """Builds the mapping of one gamepad from its events.

    Asks for the buttons, then for the stick or d-pad that steers: right and down, and all four directions for a d-pad
    of buttons. Pressing a button that is already assigned skips the control, except for the two required ones.
    """

    def __init__(self, name: str, axes: list[float], hats: int):
        """
        Args:
            name: of the gamepad.
            axes: values of its axes at rest, each in [-1, 1].
            hats: number of hats.
        """
        self._name = name
        self._rest = axes
        self._hats = hats
        self._steps = [*_BUTTONS, "dpright", "dpdown"]
        self._questions = len(self._steps)
        self._bindings: dict[str, Binding] = {}
        self._steering: list[tuple[Binding, int]] = []

    @property
    def done(self) -> bool:
        """All controls have been asked for."""
        return not self._steps

    @property
    def progress(self) -> float:
        """Proportion of the prompts that are done, in [0, 1]."""
        return 1 - len(self._steps) / self._questions

    @property
    def prompt(self) -> str:
        """The instruction for the player; empty when done."""
        if self.done:
            return ""
        step = self._steps[0]
        if step in _STEER:
            return _STEER[step]
        skip = "" if step in _REQUIRED else "   (press a used one to skip it)"
        return f"press the button for: {_BUTTONS[step]}{skip}"

    def handle(self, event: pygame.event.Event) -> None:
        """Assigns the control of an event to the current prompt."""
        bound = None if self.done else self._binding(event)
        if bound is None:
            return
        binding, sign = bound
        if self._steps[0] in _STEER:
            self._steer(binding, sign)
        elif binding.kind == "b":
            used = binding in self._bindings.values()
            if used and self._steps[0] in _REQUIRED:
                return
            control = self._steps.pop(0)
            if not used:
                self._bindings[control] = binding

    def result(self) -> tuple[GamepadMapping, tuple[int, int], tuple[bool, bool]]:
        """Returns the mapping, the x, y axes that steer, and whether each is reversed.

        Axes are numbered as in `InputSample.positions`: the axes, two for each hat, then those of a d-pad of buttons.
        """
        (right, right_sign), (down, down_sign) = self._steering[:2]
        bindings, invert = dict(self._bindings), (right_sign < 0, down_sign < 0)
        if right.kind == "a":
            bindings["leftx"] = Binding("a", right.index, inverted=invert[0])
            bindings["lefty"] = Binding("a", down.index, inverted=invert[1])
            return GamepadMapping(self._name, bindings, "user"), (right.index, down.index), invert
        if right.kind == "h":
            first = len(self._rest) + 2 * right.index
            for control, direction in (("dpup", 1), ("dpright", 2), ("dpdown", 4), ("dpleft", 8)):
                bindings[control] = Binding("h", right.index, direction=direction)
        else:
            first = len(self._rest) + 2 * self._hats
            bindings |= {control: button for control, (button, _) in zip(_STEER, self._steering, strict=True)}
            invert = (False, False)
        return GamepadMapping(self._name, bindings, "user"), (first, first + 1), invert

    def _steer(self, binding: Binding, sign: int) -> None:
        if not self._steering:
            if binding.kind == "b":
                if binding in self._bindings.values():
                    return
                self._steps += ["dpleft", "dpup"]
                self._questions += 2
            if binding.kind == "h" and binding.direction not in (2, 8):
                return
        else:
            first = self._steering[0][0]
            if binding.kind != first.kind:
                return
            if binding.kind == "b" and (binding in self._bindings.values() or (binding, 1) in self._steering):
                return
            # The stick is still returning from the right.
            if binding.kind == "a" and binding.index == first.index:
                return
            if binding.kind == "h" and (binding.index != first.index or binding.direction not in (1, 4)):
                return
        self._steering.append((binding, sign))
        self._steps.pop(0)

    def _binding(self, event: pygame.event.Event) -> tuple[Binding, int] | None:
        if event.type == pygame.JOYBUTTONDOWN:
            return Binding("b", event.button), 1
        if event.type == pygame.JOYHATMOTION:
            x, y = event.value
            if bool(x) == bool(y):
                return None  # at rest, or diagonal
            direction = (2 if x > 0 else 8) if x else (1 if y > 0 else 4)
            return Binding("h", event.hat, direction=direction), (x if x else -y)
        if event.type == pygame.JOYAXISMOTION and event.axis < len(self._rest):
            moved = event.value - self._rest[event.axis]
            if abs(moved) > _MIN_MOVE:
                return Binding("a", event.axis), (1 if moved > 0 else -1)
        return None
