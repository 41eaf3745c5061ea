"""Two gamepads as one LeRobot teleoperator."""

import logging
import math
import time
from pathlib import Path
from typing import Any

from lerobot.teleoperators.teleoperator import Teleoperator
from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected
from lerobot.utils.errors import DeviceNotConnectedError

from copolicy.collect.devices import open_gamepads, poll_gamepads
from copolicy.collect.inputs import (
    CalibrationRun,
    CalibrationStore,
    DuplicateDetector,
    Gamepad,
    Gamepads,
    user_config_folder,
)
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import get_task
from copolicy.dataset.task_spec import PLAYERS, RECORD_HZ

from .config_copolicy_pair import CopolicyPairConfig

logger = logging.getLogger(__name__)

_ALONE_SAMPLES = 3  # readings of one gamepad pressed alone; two entries of one gamepad may be read one after the other


class CopolicyPair(Teleoperator):
    """Reads both players' forces from two gamepads.

    Action: `robot_fx, robot_fy, human_fx, human_fy` in [-1, 1], x to the right and y down on the screen, after the
    gamepad's calibration and dead zone. It is one teleoperator with prefixed keys, like LeRobot's two-armed ones, since
    `lerobot-record` takes one.

    It reads the joystick events of SDL and leaves those of a window in the queue. `get_action` reads the current state.
    """

    config_class = CopolicyPairConfig
    name = "copolicy_pair"

    def __init__(self, config: CopolicyPairConfig):
        """
        Raises:
            InvalidValueError: both seats have the same gamepad, a number is negative, or `timeout_s` is not positive.
        """
        super().__init__(config)
        if config.robot_pad == config.human_pad or min(config.robot_pad, config.human_pad) < 0:
            raise InvalidValueError(
                "robot_pad, human_pad", "two different gamepads, from 0", (config.robot_pad, config.human_pad)
            )
        if not config.timeout_s > 0:
            raise InvalidValueError("timeout_s", "a positive number", config.timeout_s)
        self.config = config
        self._calibrations = CalibrationStore(config.calibration_dir or user_config_folder())
        self._pads: Gamepads | None = None
        self._seats: list[Gamepad] = []
        self._duplicates = DuplicateDetector()

    @property
    def action_features(self) -> dict[str, type]:
        """Names of the four forces."""
        return dict.fromkeys(get_task().spec.joint_action.names, float)

    @property
    def feedback_features(self) -> dict[str, type]:
        """No feedback."""
        return {}

    @property
    def is_connected(self) -> bool:
        """Whether both seats' gamepads were plugged in at the last reading."""
        return self._pads is not None and all(self._pads.get(pad.instance_id) is not None for pad in self._seats)

    @property
    def is_calibrated(self) -> bool:
        """Whether both gamepads have been calibrated, here or in the lobby of `copolicy-collect play`."""
        return bool(self._seats) and all(self._calibrations.for_gamepad(pad).measured for pad in self._seats)

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:
        """Assigns a gamepad to each seat, and calibrates those without a calibration.

        Raises:
            DeviceNotConnectedError: fewer than two gamepads, no press of a button in time, or a gamepad cannot steer.
        """
        pads = open_gamepads(self.config.calibration_dir)
        poll_gamepads(pads)
        if len(pads) < len(PLAYERS):
            raise DeviceNotConnectedError(f"{self.name}: expected two gamepads, found {len(pads)} plugged in")
        if self.config.join:
            seats = self._join(pads)
        else:
            seats = [_by_number(pads, number) for number in (self.config.robot_pad, self.config.human_pad)]
        for pad in seats:
            if not pad.steering_options:
                raise DeviceNotConnectedError(
                    f"{self.name}: expected a stick or a d-pad to steer with, found none on {pad.name}"
                )
        self._pads, self._seats, self._duplicates = pads, seats, DuplicateDetector()
        for seat, pad in zip(PLAYERS, seats, strict=True):
            logger.info("%s seat: %s", seat, pad.name)
        if calibrate and not self.is_calibrated:
            self.calibrate()
        self._warn_of_resting_push()
        self.configure()

    def calibrate(self) -> None:
        """Measures centre and range of each gamepad without a calibration; one that is not moved keeps default values.

        Raises:
            DeviceNotConnectedError: a gamepad was unplugged.
        """
        for seat, pad in zip(PLAYERS, self._seats, strict=True):
            current = self._calibrations.for_gamepad(pad)
            if current.measured:
                continue
            run = CalibrationRun(current)
            logger.info("%s seat: let go of the stick, then turn it round its edge", seat)
            end = time.monotonic() + self.config.timeout_s
            while run.stage != "done" and time.monotonic() < end:
                self._read()
                run.add(pad.sample(time.monotonic_ns()).positions)
                time.sleep(1 / RECORD_HZ)
            if run.stage == "done":
                self._calibrations.put(pad.guid, run.result())
            else:
                logger.warning("%s seat: not turned round in time, the default range is used", seat)

    def configure(self) -> None:
        """Gamepads have no settings."""

    @check_if_not_connected
    def get_action(self) -> dict[str, float]:
        """Reads the current forces.

        Raises:
            DeviceNotConnectedError: a gamepad was unplugged, or both seats have the same one, which the system lists
                twice; `disconnect` and `connect` assign gamepads again.
        """
        self._read()
        samples = [pad.sample(time.monotonic_ns()) for pad in self._seats]
        self._duplicates.add(*samples)
        if self._duplicates.duplicate:
            names = " and ".join(pad.name for pad in self._seats)
            raise DeviceNotConnectedError(
                f"{self.name}: expected two gamepads, found one that is listed twice ({names})"
            )
        forces: list[float] = []
        for pad, sample in zip(self._seats, samples, strict=True):
            forces += pad.force(sample, self._calibrations.for_gamepad(pad))
        return dict(zip(get_task().spec.joint_action.names, forces, strict=True))

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Gamepads get no feedback."""

    def disconnect(self) -> None:
        """Releases the gamepads; SDL stays initialised, since a window of this process may use it."""
        self._pads, self._seats = None, []

    def _load_calibration(self, fpath: Path | None = None) -> None:
        """Overrides LeRobot's file of motor calibrations; `CalibrationStore` reads those of gamepads."""

    def _save_calibration(self, fpath: Path | None = None) -> None:
        """See `_load_calibration`."""

    def _read(self) -> None:
        assert self._pads is not None
        for pad in poll_gamepads(self._pads):
            for seat, bound in zip(PLAYERS, self._seats, strict=True):
                if bound.instance_id == pad.instance_id:
                    # The axes of an unplugged gamepad read as zero.
                    message = f"the gamepad of the {seat} seat ({pad.name}) was unplugged"
                    raise DeviceNotConnectedError(f"{self.name}: {message}")

    def _warn_of_resting_push(self) -> None:
        for seat, pad in zip(PLAYERS, self._seats, strict=True):
            calibration = self._calibrations.for_gamepad(pad)
            push = math.hypot(*pad.force(pad.sample(0), calibration))
            if push and not calibration.measured:
                logger.warning("%s seat: %s pushes with %.2f and was never calibrated", seat, pad.name, push)

    def _join(self, pads: Gamepads) -> list[Gamepad]:
        """Assigns to each seat a gamepad that is pressed alone, since some drivers list one gamepad twice."""
        seats: list[Gamepad] = []
        for seat in PLAYERS:
            logger.info("%s seat: press a button", seat)
            end = time.monotonic() + self.config.timeout_s
            alone, together = 0, ""
            while True:
                poll_gamepads(pads)
                pressed = [pad for pad in pads if any(_pressed(pad))]
                free = [pad for pad in pressed if pad not in seats]
                if free and len(free) < len(pressed):
                    alone, together = 0, f": {free[0].name} was pressed together with the other gamepad"
                elif free:
                    alone += 1
                else:
                    alone = 0
                if free and (not seats or alone >= _ALONE_SAMPLES):
                    seats.append(free[0])
                    break
                if time.monotonic() > end:
                    raise DeviceNotConnectedError(
                        f"{self.name}: expected a press of a button for the {seat} seat within "
                        f"{self.config.timeout_s:g} s, found none{' on another gamepad' if together else ''}{together}"
                    )
                time.sleep(1 / RECORD_HZ)
        return seats


def _pressed(pad: Gamepad) -> tuple[bool, ...]:
    """State of the buttons and directions; with the latter, a gamepad without buttons can be assigned too."""
    sample = pad.sample(0)
    return (*sample.buttons, *(direction != 0 for direction in sample.directions))


def _by_number(pads: Gamepads, number: int) -> Gamepad:
    ordered = sorted(pads, key=lambda pad: pad.instance_id)
    if number >= len(ordered):
        raise DeviceNotConnectedError(
            f"copolicy_pair: expected a gamepad number {number}, found {len(ordered)} plugged in"
        )
    return ordered[number]
