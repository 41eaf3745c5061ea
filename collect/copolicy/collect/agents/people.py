"""A person as an agent, with a gamepad or one half of the keyboard."""

import time
from collections.abc import Callable

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import InvalidValueError, RunError
from copolicy.dataset.recording.messages.copolicy_pb2 import PlayerInput
from copolicy.dataset.task_spec import Vector

from ..inputs import Gamepad, InputSample, KeyboardHalf, RestOffsetDetector, StickCalibration, keyboard_force
from ..rollout import Agent

Force = tuple[float, float]

_PLANE = Vector(("x", "y"), ("a player's full force",) * 2, (-1.0, -1.0), (1.0, 1.0))


class PersonAgent(Agent):
    """A person with an input device, which can be replaced when it is unplugged.

    `act` reads the device, so that each reading is used for one step. An action of two numbers is the deflection of the
    stick, x and y; an action of one number is its x, positive to the right. Full deflection is the bound of a number.

    Attributes:
        name: kind of the device.
    """

    is_person = True

    def __init__(self, name: str, clock: Callable[[], int] = time.monotonic_ns, action: Vector = _PLANE):
        """
        Args:
            clock: monotonic time, ns.
            action: vector of one player's action in the task.

        Raises:
            InvalidValueError: the action has more numbers than a stick, or its bounds exclude 0.
        """
        if not (len(action) in (1, 2) and all(low <= 0 <= high for low, high in zip(*action.bounds, strict=True))):
            expected = "a task with actions of one or two numbers that can be 0, as a stick has"
            raise InvalidValueError(f"--players {name}", expected, action.names)
        self.name = name
        self._bounds = action.bounds
        self._device: Gamepad | KeyboardHalf | None = None
        self._calibration = StickCalibration()
        self._rest_detector = RestOffsetDetector()
        self._clock = clock

    @property
    def device(self) -> Gamepad | KeyboardHalf | None:
        """Gamepad or half of the keyboard; None until the player has joined."""
        return self._device

    @device.setter
    def device(self, device: Gamepad | KeyboardHalf | None) -> None:
        self._device, self._rest_detector = device, RestOffsetDetector()

    @property
    def calibration(self) -> StickCalibration:
        """Calibration of the stick."""
        return self._calibration

    @calibration.setter
    def calibration(self, calibration: StickCalibration) -> None:
        self._calibration, self._rest_detector = calibration, RestOffsetDetector()

    @property
    def push_at_rest(self) -> float:
        """Force of the stick at rest, as a proportion of the full force; 0 for a centred stick."""
        return self._rest_detector.force

    def watch_rest(self) -> None:
        """Measures the stick between episodes; called once a tick."""
        if self._has_stick:
            still = RestOffsetDetector.MEASURED if self.calibration.measured else RestOffsetDetector.UNMEASURED
            self._rest_detector.add(self.force(self.sample()), still)

    def sample(self) -> InputSample:
        """Reads the device.

        Raises:
            RunError: there is no device.
        """
        if self.device is None:
            raise RunError(f"{self.name}: expected a device, found none")
        return self.device.sample(self._clock())

    def force(self, sample: InputSample) -> Force:
        """The force of a sample, x and y in [-1, 1]."""
        device = self.device
        return device.force(sample, self.calibration) if isinstance(device, Gamepad) else keyboard_force(sample)

    def act(self, states: Array, worlds: Array) -> Array:
        """Reads the device; the event queue must have been pumped just before."""
        sample = self.sample()
        force = self.force(sample)
        if self._has_stick and not self.calibration.measured:
            self._rest_detector.add(force, RestOffsetDetector.IN_EPISODE)
        age = self._clock() - sample.time_ns
        self.input = PlayerInput(axes=sample.positions, buttons=sample.buttons, age_ns=age)
        low, high = self._bounds
        deflection = np.array(force[: len(high)])
        return np.where(deflection > 0, deflection * high, deflection * -low)[None]

    @property
    def _has_stick(self) -> bool:
        device = self.device
        return isinstance(device, Gamepad) and not device.steering(self.calibration).digital
