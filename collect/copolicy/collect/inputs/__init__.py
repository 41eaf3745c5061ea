"""Input devices: gamepads and the keyboard, their calibration and mapping, and the commands that they give."""

from .calibration import CalibrationRun, StickCalibration
from .calibration_store import CalibrationStore, user_config_folder
from .commands import Command, CommandReader, Press
from .duplicates import DuplicateDetector, PressLog
from .gamepads import Gamepad, Gamepads, InputSample
from .keyboard import HALVES, KeyboardHalf, keyboard_force
from .mapping import GamepadMapping, MappingRun, MappingStore
from .rest_offset import RestOffsetDetector

__all__ = [
    "HALVES",
    "CalibrationRun",
    "CalibrationStore",
    "Command",
    "CommandReader",
    "DuplicateDetector",
    "Gamepad",
    "GamepadMapping",
    "Gamepads",
    "InputSample",
    "KeyboardHalf",
    "MappingRun",
    "MappingStore",
    "Press",
    "PressLog",
    "RestOffsetDetector",
    "StickCalibration",
    "keyboard_force",
    "user_config_folder",
]
