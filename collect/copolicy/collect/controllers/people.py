"""People: a joystick, or one half of the keyboard."""

import time
from collections.abc import Callable

import numpy as np

from copolicy.dataset.exceptions import RunError
from copolicy.dataset.messages.copolicy_pb2 import PlayerInput
from copolicy.dataset.task import MapConfig

from ..inputs import InputSample, KeyboardHalf, Pad, StickCalibration, keyboard_force
from .controller import Reading

Force = tuple[float, float]


class PersonController:
    """A person with a device in hand; which one can change whenever it is unplugged.

    The device is read in `read` itself, so a reading serves one step and no other.

    Attributes:
        device: joystick or half of the keyboard; None until somebody has joined with one.
        calibration: of a joystick.
    """

    is_person = True

    def __init__(self, name: str, clock: Callable[[], int] = time.monotonic_ns):
        self.name = name
        self.device: Pad | KeyboardHalf | None = None
        self.calibration = StickCalibration()
        self._clock = clock

    def sample(self) -> InputSample:
        """What the device says now.

        Raises:
            RunError: there is no device.
        """
        if self.device is None:
            raise RunError(f"{self.name}: expected a device, found none")
        return self.device.sample(self._clock())

    def force(self, sample: InputSample) -> Force:
        """The force that a sample stands for."""
        return self.calibration.force(sample.axes) if isinstance(self.device, Pad) else keyboard_force(sample)

    def begin(self, seat: int, map_config: MapConfig, seed: int) -> None:
        """Nothing to prepare."""

    def read(self, state: np.ndarray) -> Reading:
        """Reads the device."""
        sample = self.sample()
        force = self.force(sample)
        age = self._clock() - sample.time_ns
        return Reading(force, PlayerInput(axes=sample.axes, buttons=sample.buttons, age_ns=age))

    def executed(self, action: np.ndarray) -> None:
        """A person sees for themselves."""

    def close(self) -> None:
        """The device stays as it is."""
