"""What a player sets up in the lobby: the stick's centre and range, what steers, what the buttons mean."""

from dataclasses import replace

from ..inputs import CalibrationRun, MappingRun, Pad, StickCalibration
from ..inputs.calibration import DEAD_ZONES
from ..sdl import pygame
from .game import Game
from .menu import Item, Menu
from .player import Player

_RESTING = "calibrating: let go of the stick"
_TURNING = "now turn it all the way round, twice"
_SUBMENU = "steering"


class StickSetup:
    """The set-up of one player's gamepad, who holds one.

    Attributes:
        submenu: in place of the player's menu; None while that is there.
        message: to be shown to everybody; empty where there is none.
    """

    def __init__(self, game: Game, player: Player):
        self.submenu: Menu | None = None
        self.message = ""
        self._game = game
        self._player = player
        self._calibrating: CalibrationRun | None = None
        self._mapping: MappingRun | None = None

    @property
    def busy(self) -> bool:
        """A calibration or a mapping is being made."""
        return self._calibrating is not None or self._mapping is not None

    @property
    def prompt(self) -> str:
        """What to do next, while `busy`."""
        if self._mapping is not None:
            return self._mapping.prompt
        return _RESTING if self._calibrating is not None and self._calibrating.stage == "rest" else _TURNING

    @property
    def progress(self) -> float:
        """Share that is done, while `busy`."""
        run = self._mapping or self._calibrating
        return run.progress if run is not None else 0.0

    @property
    def notice(self) -> str:
        """What is wrong with the gamepad; empty where nothing is."""
        pad, person = self._player.device, self._player.person
        if person is None or not isinstance(pad, Pad):
            return ""
        if person.push_at_rest:
            return f"pushes with {person.push_at_rest:.2f} at rest: calibrate the stick"
        return "" if pad.mapping.known else "the buttons of this pad are not known: set them up"

    def items(self, pad: Pad, calibration: StickCalibration) -> list[Item]:
        """The entries of the player's menu."""
        return [
            ("calibrate the stick", "calibrate"),
            (f"dead zone  {calibration.dead_zone:.2f}", "dead_zone"),
            (f"steering: {pad.steering(calibration).label}", _SUBMENU),
            ("set up the buttons", "buttons"),
        ]

    def refresh(self, pad: Pad, calibration: StickCalibration) -> None:
        """Gives the submenu its present values."""
        if self.submenu is not None:
            left_right, up_down = ("yes" if one else "no" for one in calibration.invert)
            self.submenu.items = [
                (f"steer with: {pad.steering(calibration).label}", "axes"),
                (f"left-right inverted: {left_right}", "invert_x"),
                (f"up-down inverted: {up_down}", "invert_y"),
                ("done", "close"),
            ]

    def choose(self, choice: str) -> None:
        """Does what an entry of the menu says."""
        pad, person = self._player.device, self._player.person
        if person is None or not isinstance(pad, Pad):
            return
        if choice == "calibrate":
            if pad.steering(person.calibration).digital:
                self.message = "a d-pad needs no calibration"
            else:
                self._calibrating = CalibrationRun(person.calibration)
        elif choice == "buttons":
            self._mapping = MappingRun(pad.name, list(pad.sample(0).axes), pad.hats)
        elif choice == _SUBMENU:
            self.submenu = Menu("", [])
            self.refresh(pad, person.calibration)
        elif choice == "close":
            self.submenu = None
        else:
            self.change(choice, 1)

    def change(self, choice: str, step: int) -> None:
        """Sets a value of the menu to its next or previous one."""
        pad, person = self._player.device, self._player.person
        if person is None or not isinstance(pad, Pad):
            return
        calibration = person.calibration
        x, y = calibration.invert
        match choice:
            case "dead_zone":
                smallest, largest = DEAD_ZONES
                steps = round((largest - smallest) / 0.01) + 1
                at = (round((calibration.dead_zone - smallest) / 0.01) + step) % steps
                changed = replace(calibration, dead_zone=round(smallest + 0.01 * at, 2))
            case "axes":
                changed = _other_axes(pad, calibration, step)
            case "invert_x":
                changed = replace(calibration, invert=(not x, y))
            case "invert_y":
                changed = replace(calibration, invert=(x, not y))
            case _:
                return
        self._calibrate(changed)

    def takes(self, event: pygame.event.Event) -> bool:
        """Takes an event of the gamepad while its buttons are set up; says whether it was one."""
        if self._mapping is None or getattr(event, "instance_id", None) != self._player.device_id:
            return False
        self._mapping.handle(event)
        return True

    def tick(self) -> bool:
        """Reads the stick for a calibration; says whether something was completed."""
        pad, person = self._player.device, self._player.person
        if person is None or not isinstance(pad, Pad):
            self.cancel()
            return False
        if self._mapping is not None and self._mapping.done:
            mapping, axes, invert = self._mapping.result()
            self._mapping = None
            try:
                self._game.roster.pads.describe(pad.guid, mapping)
            except OSError as error:
                self.message = f"buttons not saved: {error.strerror}"
            self._calibrate(_with_axes(pad, person.calibration, axes, invert))
            return True
        if self._calibrating is not None:
            self._calibrating.add(person.sample().positions)
            if self._calibrating.stage == "done":
                calibration, self._calibrating = self._calibrating.result(), None
                self._calibrate(calibration)
                return True
        return False

    def cancel(self) -> None:
        """Leaves what is being made as it was."""
        self._calibrating = self._mapping = self.submenu = None

    def _calibrate(self, calibration: StickCalibration) -> None:
        try:
            self._game.roster.calibrate(self._player, calibration)
        except OSError as error:
            self.message = f"calibration not saved: {error.strerror}"


def _other_axes(pad: Pad, calibration: StickCalibration, step: int) -> StickCalibration:
    options = pad.steerings
    present = pad.steering(calibration)
    at = options.index(present) + step if present in options else 0
    chosen = options[at % len(options)]
    return _with_axes(pad, calibration, chosen.axes, chosen.invert)


def _with_axes(
    pad: Pad, calibration: StickCalibration, axes: tuple[int, int], invert: tuple[bool, bool]
) -> StickCalibration:
    """A calibration for other axes; centre and range belong to those that were measured."""
    if axes == calibration.axes:
        return replace(calibration, invert=invert)
    fresh = StickCalibration(axes=axes, dead_zone=calibration.dead_zone, invert=invert)
    return replace(fresh, measured=pad.steering(fresh).digital)
