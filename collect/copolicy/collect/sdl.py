"""pygame, imported quietly and with the settings that must stand before it is.

`from .sdl import pygame` in place of `import pygame`: the latter greets on stdout, where `--json` promises one
object, and pygame 2.6 warns about a package of setuptools that it uses.
"""

import os
import warnings

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
# SDL drops the input of all joysticks while a window exists without the keyboard's focus, and in a run without a
# window there is no focus at all. A lost focus pauses the episode anyway.
os.environ.setdefault("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")
os.environ.setdefault("SDL_WINDOWS_DPI_AWARENESS", "permonitorv2")

with warnings.catch_warnings():
    warnings.filterwarnings("ignore", message="pkg_resources is deprecated", category=UserWarning)
    import pygame

__all__ = ["pygame"]
