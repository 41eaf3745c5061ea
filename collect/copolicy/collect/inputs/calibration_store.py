"""The user's file of stick calibrations, by device model."""

import json
import sys
from pathlib import Path

from platformdirs import user_config_path

from copolicy.dataset.exceptions import CopolicyError, FileFormatError
from copolicy.dataset.files.file_kinds import describe_path
from copolicy.dataset.files.staging import replace_json

from .calibration import StickCalibration
from .gamepads import Gamepad

_FILE = "calibrations.json"


def user_config_folder() -> Path:
    """The folder for this user's settings, by the convention of the operating system."""
    folder = user_config_path("copolicy", appauthor=False, roaming=True)
    # On macOS, the first version ignored XDG_CONFIG_HOME and used this folder.
    former = Path.home() / "Library" / "Application Support" / "copolicy"
    return former if sys.platform == "darwin" and former.is_dir() and not folder.is_dir() else folder


class CalibrationStore:
    """Calibrations by the GUID of the device, which all devices of one model share."""

    def __init__(self, folder: Path):
        """Reads the file, if it exists; the folder may be missing.

        Raises:
            FileFormatError: the file holds no valid calibrations; it can be repaired or deleted.
        """
        self.path = folder / _FILE
        self._by_guid: dict[str, StickCalibration] = {}
        if folder.exists() and not folder.is_dir():
            raise FileFormatError(folder, "a folder of calibrations", describe_path(folder))
        if not self.path.exists():
            return
        try:
            entries = json.loads(self.path.read_text(encoding="utf-8"))
            self._by_guid = {str(guid): StickCalibration.from_json(entry) for guid, entry in entries.items()}
        except (ValueError, AttributeError, RecursionError) as error:
            raise FileFormatError(self.path, "calibrations as JSON", str(error)) from None
        except CopolicyError as error:
            raise FileFormatError(self.path, "calibrations", str(error)) from None

    def __contains__(self, guid: str) -> bool:
        """The device has been calibrated."""
        return guid in self._by_guid and self._by_guid[guid].measured

    def get(self, guid: str) -> StickCalibration:
        """Returns the calibration of a device, or the default one."""
        return self._by_guid.get(guid, StickCalibration(measured=False))

    def for_gamepad(self, gamepad: Gamepad) -> StickCalibration:
        """Returns the stored calibration, or the gamepad's default if none is stored or it lacks the stored axes."""
        stored = self._by_guid.get(gamepad.guid)
        return stored if stored is not None and gamepad.has_axes(stored.axes) else gamepad.default_calibration()

    def put(self, guid: str, calibration: StickCalibration) -> None:
        """Stores a calibration and writes the file.

        Raises:
            OSError: the file cannot be written; the calibration applies to this session only.
        """
        self._by_guid[guid] = calibration
        entries = {key: value.to_json() for key, value in sorted(self._by_guid.items())}
        replace_json(self.path, entries)
