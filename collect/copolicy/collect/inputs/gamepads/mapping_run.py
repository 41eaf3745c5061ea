"""Setting up a pad that SDL does not know: press what is asked for, one control after the other."""

from ...sdl import pygame
from .mapping import Binding, GamepadMapping

_TILTED = 0.5  # of an axis, from where it was: a trigger may rest at its end

_BUTTONS = {
    "a": "choose and start",
    "b": "back",
    "start": "pause",
    "x": "redo",
    "y": "discard",
    "leftshoulder": "add a note",
    "rightshoulder": "undo",
}
_NEEDED = ("a", "b")  # the lobby's menu is gone through with these two
_STEER = {
    "dpright": "push the stick or d-pad that steers to the right",
    "dpdown": "now push it down, towards you",
    "dpleft": "now to the left",
    "dpup": "now up, away from you",
}


class MappingRun:
    """Turns the events of one pad into a mapping of it.

    First the buttons, then the stick or d-pad that steers, to the right and down (a d-pad of buttons to all four
    sides). A button that has its meaning already leaves the present one without any, save for the two of the menu.
    """

    def __init__(self, name: str, axes: list[float], hats: int):
        """
        Args:
            name: of the pad.
            axes: what its axes say at rest, each in [-1, 1].
            hats: how many it has.
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
        """All was asked."""
        return not self._steps

    @property
    def progress(self) -> float:
        """Share of the questions that were answered."""
        return 1 - len(self._steps) / self._questions

    @property
    def prompt(self) -> str:
        """What to do next."""
        if self.done:
            return ""
        step = self._steps[0]
        if step in _STEER:
            return _STEER[step]
        return f"press the button for: {_BUTTONS[step]}" + ("" if step in _NEEDED else "   (a used one leaves it out)")

    def handle(self, event: pygame.event.Event) -> None:
        """Takes an event of the pad."""
        found = None if self.done else self._binding(event)
        if found is None:
            return
        binding, sign = found
        if self._steps[0] in _STEER:
            self._steer(binding, sign)
        elif binding.kind == "b":
            used = binding in self._bindings.values()
            if used and self._steps[0] in _NEEDED:
                return
            control = self._steps.pop(0)
            if not used:
                self._bindings[control] = binding

    def result(self) -> tuple[GamepadMapping, tuple[int, int], tuple[bool, bool]]:
        """The mapping, the axes that steer and which of them are turned round.

        Axes are counted as in `InputSample.positions`: the axes, two for each hat, then those of a d-pad of buttons.
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
            # The stick is still on its way back from the right.
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
                return None  # at rest, or between two directions
            direction = (2 if x > 0 else 8) if x else (1 if y > 0 else 4)
            return Binding("h", event.hat, direction=direction), (x if x else -y)
        if event.type == pygame.JOYAXISMOTION and event.axis < len(self._rest):
            moved = event.value - self._rest[event.axis]
            if abs(moved) > _TILTED:
                return Binding("a", event.axis), (1 if moved > 0 else -1)
        return None
