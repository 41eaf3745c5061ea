"""Configuration of the pair's teleoperator, and its registration with LeRobot."""

from dataclasses import dataclass

from lerobot.teleoperators.config import TeleoperatorConfig


@TeleoperatorConfig.register_subclass("copolicy_pair")
@dataclass
class CopolicyPairConfig(TeleoperatorConfig):
    """Configuration of `CopolicyPair`; LeRobot finds that class in the module `copolicy_pair`.

    Calibrations are shared with `copolicy-collect`, one per model of gamepad; `calibration_dir` names another folder.
    """

    # Assign a gamepad to each seat by a press of any of its buttons, first the robot's, then the human's. Two gamepads
    # of one model cannot be distinguished otherwise. False: assign by the numbers below.
    join: bool = True
    # Without `join`: number of each seat's gamepad, in the order of plugging.
    robot_pad: int = 0
    human_pad: int = 1
    # Seconds to wait for each press, and for each calibration.
    timeout_s: float = 30.0
