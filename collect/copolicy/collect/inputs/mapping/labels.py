"""The labels printed on the buttons of a gamepad, by manufacturer."""

from collections.abc import Mapping

from .mapping import GamepadMapping

_CONTROLS: tuple[str, ...] = ("a", "b", "x", "y", "back", "start", "leftshoulder", "rightshoulder")
_XBOX: dict[str, str] = dict(zip(_CONTROLS, ("A", "B", "X", "Y", "View", "Menu", "LB", "RB"), strict=True))
_PLAYSTATION: dict[str, str] = dict(
    zip(_CONTROLS, ("Cross", "Circle", "Square", "Triangle", "Share", "Options", "L1", "R1"), strict=True)
)
_PLAYSTATION_OLD = _PLAYSTATION | {"back": "Select", "start": "Start"}
_DUALSENSE = _PLAYSTATION | {"back": "Create"}
_NINTENDO = _XBOX | {"back": "-", "start": "+", "leftshoulder": "L", "rightshoulder": "R"}
# Words in the names of devices and of SDL's mappings, in lower case; the first match applies.
_BY_NAME: tuple[tuple[tuple[str, ...], Mapping[str, str]], ...] = (
    (("ps5", "dualsense"), _DUALSENSE),
    (("ps3", "ps2", "psx", "sixaxis", "playstation(r)3", "playstation 3", "playstation 2"), _PLAYSTATION_OLD),
    (("ps4", "dualshock", "playstation", "sony"), _PLAYSTATION),
    (("nintendo", "switch", "joy-con", "joycon", "wii u"), _NINTENDO),
    (("xbox", "x-box", "microsoft", "xinput", "steam"), _XBOX),
)
_SONY, _NINTENDO_VENDOR, _MICROSOFT = 0x054C, 0x057E, 0x045E
_SONY_PRODUCTS = {0x0268: _PLAYSTATION_OLD, 0x0CE6: _DUALSENSE, 0x0DF2: _DUALSENSE}  # PS3, PS5, PS5 Edge
_GENERIC = {"back": "Back", "start": "Start"}


class Labels:
    """The labels of one gamepad; `labels["a"]` is `A`, `Cross` or `button 0`."""

    def __init__(self, mapping: GamepadMapping, device_name: str, guid: str):
        self._mapping = mapping
        self._printed = _printed(mapping, device_name, guid)

    def __getitem__(self, control: str) -> str:
        """Returns the label of a control; empty if the gamepad lacks it."""
        binding = self._mapping.bindings.get(control)
        if binding is None:
            return ""
        if self._printed is None:
            return f"button {binding.index}" if binding.kind == "b" else _GENERIC.get(control, control)
        return self._printed.get(control, control)

    def either(self, *controls: str) -> str:
        """Returns the labels of those controls that the gamepad has, joined by "or"."""
        return " or ".join(label for label in (self[control] for control in controls) if label)


def vendor_and_product(guid: str) -> tuple[int, int]:
    """Returns the USB vendor and product ids in SDL's GUID of a device; zeros if it has none."""
    data = bytes.fromhex(guid)
    # Without ids SDL fills these bytes with the device's name.
    if len(data) != 16 or data[6:8] != b"\0\0" or data[10:12] != b"\0\0":
        return 0, 0
    return int.from_bytes(data[4:6], "little"), int.from_bytes(data[8:10], "little")


def _printed(mapping: GamepadMapping, device_name: str, guid: str) -> Mapping[str, str] | None:
    """Returns the label of each control, or None if unknown: then buttons are shown by their numbers."""
    if not mapping.is_known:
        return None
    vendor, product = vendor_and_product(guid)
    if vendor == _SONY:
        return _SONY_PRODUCTS.get(product, _PLAYSTATION)
    if vendor == _NINTENDO_VENDOR:
        return _NINTENDO
    if vendor == _MICROSOFT:
        return _XBOX
    name = f"{mapping.name} {device_name}".lower()
    for words, printed in _BY_NAME:
        if any(word in name for word in words):
            return printed
    # SDL's list has no labels, but most of its gamepads have these; those of a user's mapping are unknown.
    return _XBOX if mapping.source == "sdl" else None
