"""The joysticks that are plugged in, by the number that SDL gives each for as long as it stays."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from copolicy.dataset.exceptions import InvalidValueError

from ..sdl import pygame
from .calibration import StickCalibration
from .gamepads import UNKNOWN, GamepadMapping, Labels, MappingStore
from .steering import Steering, steering_of, steerings


@dataclass(frozen=True)
class InputSample:
    """What a device said at one moment.

    Attributes:
        directions: two numbers for each hat, x (right) and y (down), then two of a d-pad of buttons.
    """

    axes: tuple[float, ...]
    buttons: tuple[bool, ...]
    time_ns: int  # monotonic
    directions: tuple[float, ...] = ()

    @property
    def positions(self) -> tuple[float, ...]:
        """All that can steer: the axes, then the directions."""
        return self.axes + self.directions


class Pad:
    """One joystick that is plugged in.

    Attributes:
        instance_id: SDL's number of it; a device that is unplugged and plugged in again gets another.
        guid: of its make; two of a kind share it.
        mapping: what its buttons mean.
        labels: what is printed on them.
        steerings: all that it can steer with, the best first.
    """

    def __init__(self, joystick: pygame.joystick.JoystickType, mapping: GamepadMapping = UNKNOWN):
        self._joystick = joystick
        self.instance_id: int = joystick.get_instance_id()
        self.name: str = joystick.get_name().strip() or "joystick"
        self.guid: str = joystick.get_guid()
        self.axes: int = joystick.get_numaxes()
        self.buttons: int = joystick.get_numbuttons()
        self.hats: int = joystick.get_numhats()
        self.describe(mapping)

    def describe(self, mapping: GamepadMapping) -> None:
        """Gives its buttons and axes another meaning."""
        self.mapping = mapping
        self.labels = Labels(mapping, self.name, self.guid)
        self.steerings = steerings(mapping, self.axes, self.hats)
        cross = mapping.cross_buttons
        self._cross = cross if cross is not None and max(cross) < self.buttons else None

    def sample(self, time_ns: int) -> InputSample:
        """What it says, as of the last pump of the event queue."""
        stick = self._joystick
        directions: list[float] = []
        for hat in range(self.hats):
            x, y = stick.get_hat(hat)
            directions += [float(x), float(-y)]
        if self._cross is not None:
            left, right, up, down = (int(stick.get_button(button)) for button in self._cross)
            directions += [float(right - left), float(down - up)]
        return InputSample(
            tuple(stick.get_axis(axis) for axis in range(self.axes)),
            tuple(bool(stick.get_button(button)) for button in range(self.buttons)),
            time_ns,
            tuple(directions),
        )

    def force(self, sample: InputSample, calibration: StickCalibration) -> tuple[float, float]:
        """The force of a reading, each component in [-1, 1]; the diagonals of a d-pad are no stronger than the rest."""
        x, y = calibration.force(sample.positions)
        size = math.hypot(x, y)
        return (x / size, y / size) if size > 1 and self.steering(calibration).digital else (x, y)

    def steering(self, calibration: StickCalibration) -> Steering:
        """What it steers with by a calibration."""
        return steering_of(self.steerings, calibration.axes, self.axes)

    def has_axes(self, axes: tuple[int, int]) -> bool:
        """It has both axes, counted as in `InputSample.positions`."""
        return max(axes) < self.axes + 2 * self.hats + 2 * (self._cross is not None)

    def usual_calibration(self) -> StickCalibration:
        """What suits most devices of its kind; there is nothing to measure on a d-pad."""
        if not self.steerings:
            return StickCalibration(measured=False)
        best = self.steerings[0]
        return StickCalibration(axes=best.axes, invert=best.invert, measured=best.digital)


class Pads:
    """All joysticks; `handle` must see every event, since values alone never tell that one is gone."""

    def __init__(self, mappings: MappingStore | None = None):
        """Opens what is plugged in.

        Args:
            mappings: that the user made; they go before those of SDL.
        """
        pygame.joystick.init()
        self._pads: dict[int, Pad] = {}
        self._mappings = mappings
        described = sdl_mappings()
        for index in range(pygame.joystick.get_count()):
            self._open(index, described.get(index))

    def handle(self, event: pygame.event.Event) -> tuple[Pad | None, Pad | None]:
        """Follows plugging and unplugging.

        Returns:
            The pad that came, the pad that went; None where none did.
        """
        if event.type == pygame.JOYDEVICEADDED:
            return self._open(event.device_index, sdl_mappings().get(event.device_index)), None
        if event.type == pygame.JOYDEVICEREMOVED:
            return None, self._pads.pop(event.instance_id, None)
        return None, None

    def describe(self, guid: str, mapping: GamepadMapping) -> None:
        """Gives the buttons of all pads of a make another meaning, and keeps it.

        Raises:
            OSError: it cannot be kept; it holds until the pad is unplugged.
        """
        for pad in self:
            if pad.guid == guid:
                pad.describe(mapping)
        if self._mappings is not None:
            self._mappings.put(guid, mapping)

    def _open(self, device_index: int, described: GamepadMapping | None) -> Pad | None:
        try:
            joystick = pygame.joystick.Joystick(device_index)
            own = self._mappings.get(joystick.get_guid()) if self._mappings is not None else None
            pad = Pad(joystick, own or described or UNKNOWN)
        except pygame.error:
            return None  # gone again before the event was read
        if pad.instance_id in self._pads:
            return None  # SDL tells of what was there at the start, and may tell twice
        self._pads[pad.instance_id] = pad
        return pad

    def get(self, instance_id: int) -> Pad | None:
        """The pad with a number, if it is plugged in."""
        return self._pads.get(instance_id)

    def __iter__(self) -> Iterator[Pad]:
        return iter(self._pads.values())

    def __len__(self) -> int:
        return len(self._pads)


def sdl_mappings() -> dict[int, GamepadMapping]:
    """The mapping of each device that is plugged in and that SDL knows, by its index at this moment."""
    # Here, since pygame opens it as a part of its own that is not there in every build.
    try:
        from pygame._sdl2 import controller
    except ImportError:
        return {}
    # Only for as long as it takes: an open subsystem keeps the joysticks of a program that closes them.
    opened = not controller.get_init()
    if opened:
        controller.init()
    try:
        found = {}
        for index in range(pygame.joystick.get_count()):
            if controller.is_controller(index):
                described = _read(controller.Controller(index))
                if described is not None:
                    found[index] = described
        return found
    finally:
        if opened:
            controller.quit()


def _read(device) -> GamepadMapping | None:
    try:
        return GamepadMapping.parse(device.name or "", device.get_mapping())
    except (InvalidValueError, pygame.error):
        return None  # a form that only a later SDL knows
    finally:
        device.quit()
