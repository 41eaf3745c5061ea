"""Joysticks without hardware: SDL's virtual ones, attached to the very library that pygame has loaded.

They take the whole way of a real device (SDL's event queue, hot plugging, instance ids), and appear to the program
at its next pump of the queue. Everything here may be called from a thread beside the program.
"""

import ctypes
from collections.abc import Callable
from pathlib import Path

from copolicy.collect.sdl import pygame

_FULL = 32767
_GAMECONTROLLER = 1
_DPAD = "dpup:h0.1,dpright:h0.2,dpdown:h0.4,dpleft:h0.8"
XBOX = f"a:b0,b:b1,x:b2,y:b3,leftshoulder:b4,rightshoulder:b5,back:b6,start:b7,leftx:a0,lefty:a1,{_DPAD}"
"""How the driver of Linux numbers an Xbox pad."""

PLAYSTATION = (
    "a:b1,b:b2,x:b0,y:b3,leftshoulder:b4,rightshoulder:b5,lefttrigger:b6,righttrigger:b7,back:b8,start:b9,"
    f"leftx:a0,lefty:a1,rightx:a2,righty:a5,{_DPAD}"
)
"""How many drivers number a PlayStation pad: button 7 is a trigger."""


class _Description(ctypes.Structure):
    """SDL_VirtualJoystickDesc of SDL 2.24 and later."""

    _fields_ = [
        ("version", ctypes.c_uint16),
        ("type", ctypes.c_uint16),
        ("naxes", ctypes.c_uint16),
        ("nbuttons", ctypes.c_uint16),
        ("nhats", ctypes.c_uint16),
        ("vendor_id", ctypes.c_uint16),
        ("product_id", ctypes.c_uint16),
        ("padding", ctypes.c_uint16),
        ("button_mask", ctypes.c_uint32),
        ("axis_mask", ctypes.c_uint32),
        ("name", ctypes.c_char_p),
        ("userdata", ctypes.c_void_p),
        *[
            (name, ctypes.c_void_p)
            for name in ("Update", "SetPlayerIndex", "Rumble", "RumbleTriggers", "LED", "Effect")
        ],
    ]


class _Guid(ctypes.Structure):
    _fields_ = [("data", ctypes.c_uint8 * 16)]


def _library() -> ctypes.CDLL:
    """SDL as it is mapped into this process already: a second copy would have joysticks of its own."""
    for line in Path("/proc/self/maps").read_text(encoding="utf-8").splitlines():
        if "/libSDL2-2" in line:
            sdl = ctypes.CDLL(line.split(maxsplit=5)[5])
            break
    else:
        raise RuntimeError("expected pygame to have loaded libSDL2-2, found no such library in this process")
    sdl.SDL_JoystickAttachVirtualEx.argtypes = [ctypes.POINTER(_Description)]
    sdl.SDL_JoystickDetachVirtual.argtypes = [ctypes.c_int]
    sdl.SDL_JoystickGetDeviceInstanceID.argtypes = [ctypes.c_int]
    sdl.SDL_JoystickGetGUIDString.argtypes = [_Guid, ctypes.c_char_p, ctypes.c_int]
    sdl.SDL_JoystickGetDeviceGUID.argtypes = [ctypes.c_int]
    sdl.SDL_JoystickGetDeviceGUID.restype = _Guid
    sdl.SDL_GameControllerAddMapping.argtypes = [ctypes.c_char_p]
    sdl.SDL_JoystickFromInstanceID.argtypes = [ctypes.c_int]
    sdl.SDL_JoystickFromInstanceID.restype = ctypes.c_void_p
    sdl.SDL_JoystickSetVirtualAxis.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int16]
    sdl.SDL_JoystickSetVirtualButton.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_uint8]
    sdl.SDL_JoystickSetVirtualHat.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_uint8]
    return sdl


class VirtualJoystick:
    """One plugged-in joystick; the program must have opened it before it can be moved.

    Attributes:
        instance_id: SDL's number of it.
        guid: SDL's of its make.
    """

    def __init__(
        self,
        name: str = "Test pad",
        vendor: int = 0x1209,
        product: int = 1,
        axes: int = 4,
        buttons: int = 10,
        hats: int = 1,
        mapping: str | None = XBOX,
    ):
        """
        Args:
            mapping: what SDL knows of its buttons; None for a pad that SDL does not know.
        """
        if not pygame.joystick.get_init():
            pygame.joystick.init()
        self._sdl = _library()
        self._description = _Description(
            version=1,
            type=_GAMECONTROLLER if mapping else 0,
            naxes=axes,
            nbuttons=buttons,
            nhats=hats,
            vendor_id=vendor,
            product_id=product,
            name=name.encode(),
        )
        index = self._sdl.SDL_JoystickAttachVirtualEx(ctypes.byref(self._description))
        if index < 0:
            raise RuntimeError(f"expected SDL to attach a virtual joystick, found {pygame.get_error()!r}")
        self.instance_id: int = self._sdl.SDL_JoystickGetDeviceInstanceID(index)
        text = ctypes.create_string_buffer(33)
        self._sdl.SDL_JoystickGetGUIDString(self._sdl.SDL_JoystickGetDeviceGUID(index), text, len(text))
        self.guid = text.value.decode()
        if mapping and self._sdl.SDL_GameControllerAddMapping(f"{self.guid},{name},{mapping},".encode()) < 0:
            raise RuntimeError(f"expected SDL to take the mapping {mapping!r}, found {pygame.get_error()!r}")

    @property
    def is_open(self) -> bool:
        """The program has opened it."""
        return bool(self._sdl.SDL_JoystickFromInstanceID(self.instance_id))

    def move(self, x: float, y: float) -> None:
        """Deflects the stick, x right and y down in [-1, 1]."""
        for axis, value in enumerate((x, y)):
            self.axis(axis, value)

    def axis(self, index: int, value: float) -> None:
        """Sets one axis in [-1, 1]."""
        raw = round(min(1.0, max(-1.0, value)) * _FULL)
        self._call(self._sdl.SDL_JoystickSetVirtualAxis, index, raw)

    def button(self, index: int, pressed: bool) -> None:
        """Presses or lets go of a button."""
        self._call(self._sdl.SDL_JoystickSetVirtualButton, index, int(pressed))

    def hat(self, x: int, y: int) -> None:
        """Sets the hat; y = 1 is up."""
        value = {1: 1, -1: 4, 0: 0}[y] | {1: 2, -1: 8, 0: 0}[x]
        self._call(self._sdl.SDL_JoystickSetVirtualHat, 0, value)

    def unplug(self) -> None:
        """Takes it away; it cannot be used again."""
        for index in range(self._sdl.SDL_NumJoysticks()):
            if self._sdl.SDL_JoystickGetDeviceInstanceID(index) == self.instance_id:
                self._sdl.SDL_JoystickDetachVirtual(index)
                return

    def _call(self, function: Callable[..., int], index: int, value: int) -> None:
        pointer = self._sdl.SDL_JoystickFromInstanceID(self.instance_id)
        if not pointer:
            raise RuntimeError("expected a joystick that the program has opened, found one that it has not")
        function(pointer, index, value)
