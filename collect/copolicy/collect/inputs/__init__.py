"""What the players hold in their hands: gamepads and the keyboard, their calibration, and what a press means."""

from .calibration import CalibrationRun, StickCalibration
from .calibration_store import CalibrationStore, user_config_folder
from .commands import Command, CommandReader, Press
from .gamepads import GamepadMapping, MappingRun, MappingStore
from .joysticks import InputSample, Pad, Pads
from .keyboard import HALVES, KeyboardHalf, keyboard_force
from .rest import RestWatch
from .twins import PressLog, TwinWatch

__all__ = [
    "HALVES",
    "CalibrationRun",
    "CalibrationStore",
    "Command",
    "CommandReader",
    "GamepadMapping",
    "InputSample",
    "KeyboardHalf",
    "MappingRun",
    "MappingStore",
    "Pad",
    "Pads",
    "Press",
    "PressLog",
    "RestWatch",
    "StickCalibration",
    "TwinWatch",
    "keyboard_force",
    "user_config_folder",
]
