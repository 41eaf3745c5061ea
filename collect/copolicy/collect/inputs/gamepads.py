"""The connected gamepads, by the instance id that SDL gives each one while it is connected."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from copolicy.dataset.exceptions import InvalidValueError

from ..sdl import pygame
from .calibration import StickCalibration
from .mapping import UNKNOWN, GamepadMapping, Labels, MappingStore
from .steering import SteeringAxes, select_steering, steering_options


@dataclass(frozen=True)
class InputSample:
    """One reading of a device.

    Attributes:
        axes: values in [-1, 1].
        buttons: True while pressed.
        directions: x (right) and y (down) of each hat, then of a d-pad of buttons; each -1, 0 or 1.
    """

    axes: tuple[float, ...]
    buttons: tuple[bool, ...]
    time_ns: int  # monotonic
    directions: tuple[float, ...] = ()

    @property
    def positions(self) -> tuple[float, ...]:
        """The axes, then the directions: all values that can steer."""
        return self.axes + self.directions


class Gamepad:
    """One connected gamepad or joystick.

    Attributes:
        instance_id: SDL's number; a device that is unplugged and plugged in again gets a new one.
        guid: of the device model; two devices of one model share it.
        mapping: of its buttons and axes to controls.
        labels: printed on its buttons.
        steering_options: the axes that can steer, the best first.
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
        """Sets the mapping of its buttons and axes."""
        self.mapping = mapping
        self.labels = Labels(mapping, self.name, self.guid)
        self.steering_options = steering_options(mapping, self.axes, self.hats)
        dpad = mapping.dpad_buttons
        self._dpad = dpad if dpad is not None and max(dpad) < self.buttons else None

    def sample(self, time_ns: int) -> InputSample:
        """Reads the device, as of the last pump of the event queue."""
        stick = self._joystick
        directions: list[float] = []
        for hat in range(self.hats):
            x, y = stick.get_hat(hat)
            directions += [float(x), float(-y)]
        if self._dpad is not None:
            left, right, up, down = (int(stick.get_button(button)) for button in self._dpad)
            directions += [float(right - left), float(down - up)]
        return InputSample(
            tuple(stick.get_axis(axis) for axis in range(self.axes)),
            tuple(bool(stick.get_button(button)) for button in range(self.buttons)),
            time_ns,
            tuple(directions),
        )

    def force(self, sample: InputSample, calibration: StickCalibration) -> tuple[float, float]:
        """Returns the force of a reading, each component in [-1, 1]; that of a d-pad has at most size 1."""
        x, y = calibration.force(sample.positions)
        size = math.hypot(x, y)
        return (x / size, y / size) if size > 1 and self.steering(calibration).digital else (x, y)

    def steering(self, calibration: StickCalibration) -> SteeringAxes:
        """Returns the axes that steer according to a calibration."""
        return select_steering(self.steering_options, calibration.axes, self.axes)

    def has_axes(self, axes: tuple[int, int]) -> bool:
        """Whether it has both axes, numbered as in `InputSample.positions`."""
        return max(axes) < self.axes + 2 * self.hats + 2 * (self._dpad is not None)

    def default_calibration(self) -> StickCalibration:
        """Returns a calibration that fits most devices; that of a d-pad needs no measurement."""
        if not self.steering_options:
            return StickCalibration(measured=False)
        best = self.steering_options[0]
        return StickCalibration(axes=best.axes, invert=best.invert, measured=best.digital)


class Gamepads:
    """All connected gamepads; `handle` needs every event, since readings do not show that a device was unplugged."""

    def __init__(self, mappings: MappingStore | None = None):
        """Opens the connected gamepads.

        Args:
            mappings: of the user; they take precedence over those of SDL.
        """
        pygame.joystick.init()
        self._gamepads: dict[int, Gamepad] = {}
        self._mappings = mappings
        sdl = sdl_mappings()
        for index in range(pygame.joystick.get_count()):
            self._open(index, sdl.get(index))

    def handle(self, event: pygame.event.Event) -> tuple[Gamepad | None, Gamepad | None]:
        """Opens a gamepad that was plugged in, and drops one that was unplugged.

        Returns:
            The added gamepad and the removed gamepad, each None if the event is another one.
        """
        if event.type == pygame.JOYDEVICEADDED:
            return self._open(event.device_index, sdl_mappings().get(event.device_index)), None
        if event.type == pygame.JOYDEVICEREMOVED:
            return None, self._gamepads.pop(event.instance_id, None)
        return None, None

    def describe(self, guid: str, mapping: GamepadMapping) -> None:
        """Sets the mapping of all gamepads of a model, and stores it.

        Raises:
            OSError: the mapping cannot be stored; it applies until the gamepad is unplugged.
        """
        for gamepad in self:
            if gamepad.guid == guid:
                gamepad.describe(mapping)
        if self._mappings is not None:
            self._mappings.put(guid, mapping)

    def _open(self, device_index: int, sdl_mapping: GamepadMapping | None) -> Gamepad | None:
        try:
            joystick = pygame.joystick.Joystick(device_index)
            user_mapping = self._mappings.get(joystick.get_guid()) if self._mappings is not None else None
            gamepad = Gamepad(joystick, user_mapping or sdl_mapping or UNKNOWN)
        except pygame.error:
            return None  # unplugged before the event was read
        if gamepad.instance_id in self._gamepads:
            return None  # SDL also sends events for devices connected at the start, sometimes twice
        self._gamepads[gamepad.instance_id] = gamepad
        return gamepad

    def get(self, instance_id: int) -> Gamepad | None:
        """Returns the connected gamepad with an instance id, or None."""
        return self._gamepads.get(instance_id)

    def __iter__(self) -> Iterator[Gamepad]:
        return iter(self._gamepads.values())

    def __len__(self) -> int:
        return len(self._gamepads)


def sdl_mappings() -> dict[int, GamepadMapping]:
    """Returns SDL's mapping of each connected device that SDL knows, by device index."""
    # Imported here, since some builds of pygame lack the module.
    try:
        from pygame._sdl2 import controller
    except ImportError:
        return {}
    # Open only during the call: an open subsystem keeps joysticks open that the program has closed.
    opened = not controller.get_init()
    if opened:
        controller.init()
    try:
        mappings = {}
        for index in range(pygame.joystick.get_count()):
            if controller.is_controller(index):
                mapping = _read(controller.Controller(index))
                if mapping is not None:
                    mappings[index] = mapping
        return mappings
    finally:
        if opened:
            controller.quit()


def _read(device) -> GamepadMapping | None:
    try:
        return GamepadMapping.parse(device.name or "", device.get_mapping())
    except (InvalidValueError, pygame.error):
        return None  # a form of mapping from a newer SDL
    finally:
        device.quit()
