"""People: a joystick, or one half of the keyboard."""

import time
from collections.abc import Callable

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError, RunError
from copolicy.dataset.recording.messages.copolicy_pb2 import PlayerInput
from copolicy.dataset.task_spec import Vector

from ..inputs import Gamepad, InputSample, KeyboardHalf, RestOffsetDetector, StickCalibration, keyboard_force
from ..rollout import Agent

Force = tuple[float, float]

_PLANE = Vector(("x", "y"), ("a player's full force",) * 2, (-1.0, -1.0), (1.0, 1.0))


class PersonAgent(Agent):
    """A person with a device in hand; which one can change whenever it is unplugged.

    The device is read in `act` itself, so a reading serves one step and no other. An action of two numbers is where the
    stick stands, x and y; one of one number is its x, to the right positive. Full deflection is the bound of a number.

    Attributes:
        name: of the kind of device.
    """

    is_person = True

    def __init__(self, name: str, clock: Callable[[], int] = time.monotonic_ns, action: Vector = _PLANE):
        """
        Args:
            action: of one player of the task.

        Raises:
            InvalidValueError: it has more numbers than a stick, or a player cannot rest.
        """
        if not (len(action) in (1, 2) and all(low <= 0 <= high for low, high in zip(*action.bounds, strict=True))):
            expected = "a task whose players act by one or two numbers that can be 0: a stick has no more"
            raise InvalidValueError(f"--players {name}", expected, action.names)
        self.name = name
        self._bounds = action.bounds
        self._device: Gamepad | KeyboardHalf | None = None
        self._calibration = StickCalibration()
        self._rest = RestOffsetDetector()
        self._clock = clock

    @property
    def device(self) -> Gamepad | KeyboardHalf | None:
        """Joystick or half of the keyboard; None until somebody has joined with one."""
        return self._device

    @device.setter
    def device(self, device: Gamepad | KeyboardHalf | None) -> None:
        self._device, self._rest = device, RestOffsetDetector()

    @property
    def calibration(self) -> StickCalibration:
        """Of a joystick."""
        return self._calibration

    @calibration.setter
    def calibration(self, calibration: StickCalibration) -> None:
        self._calibration, self._rest = calibration, RestOffsetDetector()

    @property
    def push_at_rest(self) -> float:
        """How hard the stick pushes while nobody touches it, share of the full force; 0 where it does not."""
        return self._rest.force

    def watch_rest(self) -> None:
        """Looks at the stick between the episodes; once a tick."""
        if self._has_stick:
            still = RestOffsetDetector.MEASURED if self.calibration.measured else RestOffsetDetector.UNMEASURED
            self._rest.add(self.force(self.sample()), still)

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
        device = self.device
        return device.force(sample, self.calibration) if isinstance(device, Gamepad) else keyboard_force(sample)

    def act(self, states: np.ndarray, worlds: np.ndarray) -> np.ndarray:
        """Reads the device, right after the event queue was pumped."""
        sample = self.sample()
        force = self.force(sample)
        if self._has_stick and not self.calibration.measured:
            self._rest.add(force, RestOffsetDetector.IN_EPISODE)
        age = self._clock() - sample.time_ns
        self.input = PlayerInput(axes=sample.positions, buttons=sample.buttons, age_ns=age)
        low, high = self._bounds
        deflection = np.array(force[: len(high)])
        return np.where(deflection > 0, deflection * high, deflection * -low)[None]

    @property
    def _has_stick(self) -> bool:
        device = self.device
        return isinstance(device, Gamepad) and not device.steering(self.calibration).digital
