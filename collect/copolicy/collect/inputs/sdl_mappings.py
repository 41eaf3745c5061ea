"""The mappings of gamepads that SDL knows, its own list and those of the variable `SDL_GAMECONTROLLERCONFIG`."""

from copolicy.dataset.exceptions import InvalidValueError

from ..sdl import pygame
from .gamepads import GamepadMapping


def sdl_mappings() -> dict[int, GamepadMapping]:
    """The mapping of each device that is plugged in and that SDL knows, by its index at this moment."""
    # Here, since pygame opens it as a part of its own that is not there in every build.
    try:
        from pygame._sdl2 import controller
    except ImportError:
        return {}
    # Only for as long as it takes: an open subsystem keeps the joysticks of a program that closes them.
    opened = not controller.get_init()
    if opened:
        controller.init()
    try:
        found = {}
        for index in range(pygame.joystick.get_count()):
            if controller.is_controller(index):
                described = _read(controller.Controller(index))
                if described is not None:
                    found[index] = described
        return found
    finally:
        if opened:
            controller.quit()


def _read(device) -> GamepadMapping | None:
    try:
        return GamepadMapping.parse(device.name or "", device.get_mapping())
    except (InvalidValueError, pygame.error):
        return None  # a form that only a later SDL knows
    finally:
        device.quit()
