"""Where calibrations are kept between sessions: one file of the user, by the kind of device."""

import json
import sys
from pathlib import Path

from platformdirs import user_config_path

from copolicy.dataset.exceptions import CopolicyError, FileFormatError
from copolicy.dataset.files.file_kinds import describe_path
from copolicy.dataset.files.staging import replace_json

from .calibration import StickCalibration
from .joysticks import Pad

_FILE = "calibrations.json"


def user_config_folder() -> Path:
    """The folder for settings of this user, as the system has it."""
    folder = user_config_path("copolicy", appauthor=False, roaming=True)
    # On macOS with XDG_CONFIG_HOME set, the first version did not look there.
    first = Path.home() / "Library" / "Application Support" / "copolicy"
    return first if sys.platform == "darwin" and first.is_dir() and not folder.is_dir() else folder


class CalibrationStore:
    """Calibrations by the GUID of the device, which is the same for all devices of one make."""

    def __init__(self, folder: Path):
        """Reads what is there; the folder may be missing.

        Raises:
            FileFormatError: the file is not one of calibrations; it can be repaired or deleted.
        """
        self.path = folder / _FILE
        self._by_guid: dict[str, StickCalibration] = {}
        if folder.exists() and not folder.is_dir():
            raise FileFormatError(folder, "a folder of calibrations", describe_path(folder))
        if not self.path.exists():
            return
        try:
            entries = json.loads(self.path.read_text(encoding="utf-8"))
            self._by_guid = {str(guid): StickCalibration.from_json(one) for guid, one in entries.items()}
        except (ValueError, AttributeError, RecursionError) as error:
            raise FileFormatError(self.path, "calibrations as JSON", str(error)) from None
        except CopolicyError as error:
            raise FileFormatError(self.path, "calibrations", str(error)) from None

    def __contains__(self, guid: str) -> bool:
        """The device has been calibrated."""
        return guid in self._by_guid and self._by_guid[guid].measured

    def get(self, guid: str) -> StickCalibration:
        """The calibration of a device, or the one that suits most."""
        return self._by_guid.get(guid, StickCalibration(measured=False))

    def of(self, pad: Pad) -> StickCalibration:
        """The calibration of a pad; without one, or with one of axes that it lacks, the one that suits its kind."""
        kept = self._by_guid.get(pad.guid)
        return kept if kept is not None and pad.has_axes(kept.axes) else pad.usual_calibration()

    def put(self, guid: str, calibration: StickCalibration) -> None:
        """Keeps a calibration, on the disk too.

        Raises:
            OSError: the file cannot be written; the calibration holds for this session.
        """
        self._by_guid[guid] = calibration
        entries = {key: one.to_json() for key, one in sorted(self._by_guid.items())}
        replace_json(self.path, entries)
