"""Settings of the pair's teleoperator, and its registration with LeRobot."""

from dataclasses import dataclass

from lerobot.teleoperators.config import TeleoperatorConfig


@TeleoperatorConfig.register_subclass("copolicy_pair")
@dataclass
class CopolicyPairConfig(TeleoperatorConfig):
    """Settings of `CopolicyPair`; LeRobot finds that class in the module of this one's name without `config_`.

    Calibrations are those of `copolicy-collect`, kept by the make of a pad; `calibration_dir` names another folder.
    """

    # Bind a pad to each seat by a press of any of its buttons, first the robot's, then the human's. Two pads of one
    # make cannot be told apart otherwise. False: by the numbers below.
    join: bool = True
    # Without `join`: which pad, in the order of plugging, sits on which seat.
    robot_pad: int = 0
    human_pad: int = 1
    # Seconds to wait for each press, and for each calibration.
    timeout_s: float = 30.0
