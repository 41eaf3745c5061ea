"""What the players hold in their hands: joysticks and the keyboard, their calibration, and what a press means."""

from .calibration import StickCalibration
from .calibration_run import CalibrationRun
from .calibration_store import CalibrationStore, user_config_folder
from .commands import Command, CommandReader, Press
from .joysticks import InputSample, Pad, Pads
from .keyboard import HALVES, KeyboardHalf, keyboard_force

__all__ = [
    "HALVES",
    "CalibrationRun",
    "CalibrationStore",
    "Command",
    "CommandReader",
    "InputSample",
    "KeyboardHalf",
    "Pad",
    "Pads",
    "Press",
    "StickCalibration",
    "keyboard_force",
    "user_config_folder",
]
