"""What is printed on the buttons of a pad, by its maker."""

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
# In the order in which they are looked for: words of the names of devices and of SDL's mappings, in lower case.
_BY_WORD: tuple[tuple[tuple[str, ...], Mapping[str, str]], ...] = (
    (("ps5", "dualsense"), _DUALSENSE),
    (("ps3", "ps2", "psx", "sixaxis", "playstation(r)3", "playstation 3", "playstation 2"), _PLAYSTATION_OLD),
    (("ps4", "dualshock", "playstation", "sony"), _PLAYSTATION),
    (("nintendo", "switch", "joy-con", "joycon", "wii u"), _NINTENDO),
    (("xbox", "x-box", "microsoft", "xinput", "steam"), _XBOX),
)
_SONY, _NINTENDO_VENDOR, _MICROSOFT = 0x054C, 0x057E, 0x045E
_SONY_PRODUCTS = {0x0268: _PLAYSTATION_OLD, 0x0CE6: _DUALSENSE, 0x0DF2: _DUALSENSE}  # PS3, PS5, PS5 Edge
_WORDS = {"back": "Back", "start": "Start"}


class Labels:
    """The labels of one pad; `labels["a"]` is `A`, `Cross` or `button 0`."""

    def __init__(self, mapping: GamepadMapping, device_name: str, guid: str):
        self._mapping = mapping
        self._printed = _printed(mapping, device_name, guid)

    def __getitem__(self, control: str) -> str:
        """The label of a control; empty where the pad has none."""
        binding = self._mapping.bindings.get(control)
        if binding is None:
            return ""
        if self._printed is None:
            return f"button {binding.index}" if binding.kind == "b" else _WORDS.get(control, control)
        return self._printed.get(control, control)

    def either(self, *controls: str) -> str:
        """The labels of several controls, those that the pad has."""
        return " or ".join(label for label in (self[control] for control in controls) if label)


def vendor_and_product(guid: str) -> tuple[int, int]:
    """USB numbers of a device, out of SDL's GUID of it; zeros where it has none."""
    numbers = bytes.fromhex(guid)
    # Without numbers SDL fills the rest with the name.
    if len(numbers) != 16 or numbers[6:8] != b"\0\0" or numbers[10:12] != b"\0\0":
        return 0, 0
    return int.from_bytes(numbers[4:6], "little"), int.from_bytes(numbers[8:10], "little")


def _printed(mapping: GamepadMapping, device_name: str, guid: str) -> Mapping[str, str] | None:
    """None where what is printed on the pad is not known, so that its buttons go by their numbers."""
    if not mapping.known:
        return None
    vendor, product = vendor_and_product(guid)
    if vendor == _SONY:
        return _SONY_PRODUCTS.get(product, _PLAYSTATION)
    if vendor == _NINTENDO_VENDOR:
        return _NINTENDO
    if vendor == _MICROSOFT:
        return _XBOX
    name = f"{mapping.name} {device_name}".lower()
    for words, printed in _BY_WORD:
        if any(word in name for word in words):
            return printed
    # SDL's list says nothing of letters, but most of its pads have these; of the user's own pad nobody knows.
    return _XBOX if mapping.source == "sdl" else None
