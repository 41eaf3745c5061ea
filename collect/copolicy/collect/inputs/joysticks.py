"""The joysticks that are plugged in, by the number that SDL gives each for as long as it stays."""

from dataclasses import dataclass

from ..sdl import pygame


@dataclass(frozen=True)
class InputSample:
    """What a device said at one moment."""

    axes: tuple[float, ...]
    buttons: tuple[bool, ...]
    time_ns: int  # monotonic


class Pad:
    """One joystick that is plugged in.

    Attributes:
        instance_id: SDL's number of it; a device that is unplugged and plugged in again gets another.
        guid: of its make; two of a kind share it.
    """

    def __init__(self, joystick: pygame.joystick.JoystickType):
        self._joystick = joystick
        self.instance_id: int = joystick.get_instance_id()
        self.name: str = joystick.get_name().strip() or "joystick"
        self.guid: str = joystick.get_guid()
        self.axes: int = joystick.get_numaxes()
        self.buttons: int = joystick.get_numbuttons()
        self.hats: int = joystick.get_numhats()

    def sample(self, time_ns: int) -> InputSample:
        """What it says, as of the last pump of the event queue."""
        stick = self._joystick
        return InputSample(
            tuple(stick.get_axis(axis) for axis in range(self.axes)),
            tuple(bool(stick.get_button(button)) for button in range(self.buttons)),
            time_ns,
        )


class Pads:
    """All joysticks; `handle` must see every event, since values alone never tell that one is gone."""

    def __init__(self):
        pygame.joystick.init()
        self._pads: dict[int, Pad] = {}
        for index in range(pygame.joystick.get_count()):
            self._open(index)

    def handle(self, event: pygame.event.Event) -> tuple[Pad | None, Pad | None]:
        """Follows plugging and unplugging.

        Returns:
            The pad that came, the pad that went; None where none did.
        """
        if event.type == pygame.JOYDEVICEADDED:
            return self._open(event.device_index), None
        if event.type == pygame.JOYDEVICEREMOVED:
            return None, self._pads.pop(event.instance_id, None)
        return None, None

    def _open(self, device_index: int) -> Pad | None:
        try:
            pad = Pad(pygame.joystick.Joystick(device_index))
        except pygame.error:
            return None  # gone again before the event was read
        if pad.instance_id in self._pads:
            return None  # SDL tells of what was there at the start, and may tell twice
        self._pads[pad.instance_id] = pad
        return pad

    def get(self, instance_id: int) -> Pad | None:
        """The pad with a number, if it is plugged in."""
        return self._pads.get(instance_id)

    def __iter__(self):
        return iter(self._pads.values())

    def __len__(self) -> int:
        return len(self._pads)
