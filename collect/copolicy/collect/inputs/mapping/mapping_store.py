"""The user's gamepad mappings: a file in SDL's format, next to the calibrations."""

import re
import sys
from pathlib import Path

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.staging import replace_text
from copolicy.dataset.files.text_files import read_text

from .mapping import GamepadMapping

_FILE = "gamecontrollerdb.txt"
_GUID = re.compile(r"[0-9a-f]{32}")
_PLATFORM = {"win32": "Windows", "darwin": "Mac OS X"}.get(sys.platform, "Linux")


class MappingStore:
    """Mappings by the GUID of the device, in `gamecontrollerdb.txt`; lines of SDL_GameControllerDB may be added to it.

    Attributes:
        path: of the file.
    """

    def __init__(self, folder: Path):
        """Reads the file, if it exists; the folder may be missing.

        Raises:
            FileFormatError: a line is not a mapping.
        """
        self.path = folder / _FILE
        self._lines: list[str] = []
        self._by_guid: dict[str, GamepadMapping] = {}
        if not self.path.exists():
            return
        self._lines = read_text(self.path).splitlines()
        for number, line in enumerate(self._lines, 1):
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            try:
                guid, mapping, platform = parse_line(line)
            except InvalidValueError as error:
                expected = f"a mapping in SDL's format in line {number}"
                raise FileFormatError(self.path, expected, str(error)) from None
            if platform in ("", _PLATFORM):
                self._by_guid[guid] = mapping

    def get(self, guid: str) -> GamepadMapping | None:
        """Returns the mapping of a device, or None; a GUID without a name checksum applies to devices of any name."""
        return self._by_guid.get(guid) or self._by_guid.get(_without_name(guid))

    def put(self, guid: str, mapping: GamepadMapping) -> None:
        """Stores a mapping and writes the file; other lines and comments stay.

        Raises:
            OSError: the file cannot be written; the mapping applies to this session only.
        """
        self._by_guid[guid] = mapping
        self._lines = [line for line in self._lines if not line.strip().lower().startswith(guid)]
        self._lines.append(mapping.line(guid))
        replace_text(self.path, "\n".join(self._lines) + "\n")


def parse_line(line: str) -> tuple[str, GamepadMapping, str]:
    """Returns GUID, mapping and platform of a line `GUID,name,a:b0,...,platform:Linux,`.

    Raises:
        InvalidValueError: the line has another form, or no control.
    """
    guid, *parts = (part.strip() for part in line.strip().rstrip(",").split(","))
    if not _GUID.fullmatch(guid.lower()) or not parts:
        raise InvalidValueError("mapping", "GUID,name,a:b0,b:b1,...", line.strip()[:60])
    entries = {}
    for part in parts[1:]:
        control, colon, binding = part.partition(":")
        if not colon:
            raise InvalidValueError("mapping", "entries such as a:b0", part)
        entries[control] = binding
    mapping = GamepadMapping.parse(parts[0], entries, "user")
    if not mapping.bindings:
        raise InvalidValueError("mapping", "at least one control", line.strip()[:60])
    return guid.lower(), mapping, entries.get("platform", "")


def _without_name(guid: str) -> str:
    """Clears the name checksum, which SDL keeps in bytes 2 and 3 of a GUID."""
    return f"{guid[:4]}0000{guid[8:]}"
