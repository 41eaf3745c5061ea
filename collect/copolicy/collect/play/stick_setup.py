"""The set-up of a gamepad in the lobby: calibration, steering axes and buttons."""

from dataclasses import replace

from ..inputs import CalibrationRun, Gamepad, MappingRun, StickCalibration
from ..inputs.calibration import DEAD_ZONES
from ..sdl import pygame
from .game import Game
from .menu import Item, Menu
from .player import SeatedPlayer

_RESTING = "calibrating: let go of the stick"
_TURNING = "now turn the stick around its edge twice"
_SUBMENU = "steering"


class StickSetup:
    """The set-up of one player's gamepad.

    Attributes:
        submenu: shown instead of the player's menu; None if it is closed.
        message: for both players; empty if there is none.
    """

    def __init__(self, game: Game, player: SeatedPlayer):
        self.submenu: Menu | None = None
        self.message = ""
        self._game = game
        self._player = player
        self._calibrating: CalibrationRun | None = None
        self._mapping: MappingRun | None = None

    @property
    def busy(self) -> bool:
        """A calibration or the set-up of buttons is in progress."""
        return self._calibrating is not None or self._mapping is not None

    @property
    def prompt(self) -> str:
        """The instruction for the player, while `busy`."""
        if self._mapping is not None:
            return self._mapping.prompt
        return _RESTING if self._calibrating is not None and self._calibrating.stage == "rest" else _TURNING

    @property
    def progress(self) -> float:
        """Proportion that is done, in [0, 1], while `busy`."""
        run = self._mapping or self._calibrating
        return run.progress if run is not None else 0.0

    @property
    def notice(self) -> str:
        """A fault of the gamepad and what to do about it; empty if there is none."""
        gamepad, person = self._player.device, self._player.person
        if person is None or not isinstance(gamepad, Gamepad):
            return ""
        if person.push_at_rest:
            return f"pushes with {person.push_at_rest:.2f} at rest: calibrate the stick"
        return "" if gamepad.mapping.is_known else "the buttons of this gamepad are unknown: set them up"

    def items(self, gamepad: Gamepad, calibration: StickCalibration) -> list[Item]:
        """Returns the items of the player's menu."""
        return [
            ("calibrate the stick", "calibrate"),
            (f"dead zone  {calibration.dead_zone:.2f}", "dead_zone"),
            (f"steering: {gamepad.steering(calibration).label}", _SUBMENU),
            ("set up the buttons", "buttons"),
        ]

    def refresh(self, gamepad: Gamepad, calibration: StickCalibration) -> None:
        """Updates the values in the submenu."""
        if self.submenu is not None:
            left_right, up_down = ("yes" if inverted else "no" for inverted in calibration.invert)
            self.submenu.items = [
                (f"steer with: {gamepad.steering(calibration).label}", "axes"),
                (f"left-right inverted: {left_right}", "invert_x"),
                (f"up-down inverted: {up_down}", "invert_y"),
                ("done", "close"),
            ]

    def choose(self, choice: str) -> None:
        """Carries out a menu item."""
        gamepad, person = self._player.device, self._player.person
        if person is None or not isinstance(gamepad, Gamepad):
            return
        if choice == "calibrate":
            if gamepad.steering(person.calibration).digital:
                self.message = "a d-pad needs no calibration"
            else:
                self._calibrating = CalibrationRun(person.calibration)
        elif choice == "buttons":
            self._mapping = MappingRun(gamepad.name, list(gamepad.sample(0).axes), gamepad.hats)
        elif choice == _SUBMENU:
            self.submenu = Menu("", [])
            self.refresh(gamepad, person.calibration)
        elif choice == "close":
            self.submenu = None
        else:
            self.change(choice, 1)

    def change(self, choice: str, step: int) -> None:
        """Changes the setting of a menu item by `step` values."""
        gamepad, person = self._player.device, self._player.person
        if person is None or not isinstance(gamepad, Gamepad):
            return
        calibration = person.calibration
        x, y = calibration.invert
        match choice:
            case "dead_zone":
                smallest, largest = DEAD_ZONES
                steps = round((largest - smallest) / 0.01) + 1
                index = (round((calibration.dead_zone - smallest) / 0.01) + step) % steps
                changed = replace(calibration, dead_zone=round(smallest + 0.01 * index, 2))
            case "axes":
                changed = _next_axes(gamepad, calibration, step)
            case "invert_x":
                changed = replace(calibration, invert=(not x, y))
            case "invert_y":
                changed = replace(calibration, invert=(x, not y))
            case _:
                return
        self._calibrate(changed)

    def consume(self, event: pygame.event.Event) -> bool:
        """Handles an event of the gamepad while its buttons are set up; returns whether it did."""
        if self._mapping is None or getattr(event, "instance_id", None) != self._player.device_id:
            return False
        self._mapping.handle(event)
        return True

    def tick(self) -> bool:
        """Adds a reading to a calibration; returns whether a calibration or mapping was completed."""
        gamepad, person = self._player.device, self._player.person
        if person is None or not isinstance(gamepad, Gamepad):
            self.cancel()
            return False
        if self._mapping is not None and self._mapping.done:
            mapping, axes, invert = self._mapping.result()
            self._mapping = None
            try:
                self._game.roster.gamepads.describe(gamepad.guid, mapping)
            except OSError as error:
                self.message = f"buttons not saved: {error.strerror}"
            self._calibrate(_with_axes(gamepad, person.calibration, axes, invert))
            return True
        if self._calibrating is not None:
            self._calibrating.add(person.sample().positions)
            if self._calibrating.stage == "done":
                calibration, self._calibrating = self._calibrating.result(), None
                self._calibrate(calibration)
                return True
        return False

    def cancel(self) -> None:
        """Cancels what is in progress; settings stay as they were."""
        self._calibrating = self._mapping = self.submenu = None

    def _calibrate(self, calibration: StickCalibration) -> None:
        try:
            self._game.roster.calibrate(self._player, calibration)
        except OSError as error:
            self.message = f"calibration not saved: {error.strerror}"


def _next_axes(gamepad: Gamepad, calibration: StickCalibration, step: int) -> StickCalibration:
    options = gamepad.steering_options
    current = gamepad.steering(calibration)
    index = options.index(current) + step if current in options else 0
    option = options[index % len(options)]
    return _with_axes(gamepad, calibration, option.axes, option.invert)


def _with_axes(
    gamepad: Gamepad, calibration: StickCalibration, axes: tuple[int, int], invert: tuple[bool, bool]
) -> StickCalibration:
    """Returns a calibration for these axes; centre and range are kept only if the axes stay the same."""
    if axes == calibration.axes:
        return replace(calibration, invert=invert)
    default = StickCalibration(axes=axes, dead_zone=calibration.dead_zone, invert=invert)
    return replace(default, measured=gamepad.steering(default).digital)
