"""pygame, imported quietly and with the settings that must stand before it is.

`from .sdl import pygame` in place of `import pygame`: the latter greets on stdout, where `--json` promises one
object, and pygame 2.6 warns about a package of setuptools that it uses.
"""

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
# SDL drops the input of all joysticks while a window exists without the keyboard's focus, and in a run without a
# window there is no focus at all. A lost focus pauses the episode anyway.
os.environ.setdefault("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")
os.environ.setdefault("SDL_WINDOWS_DPI_AWARENESS", "permonitorv2")

with warnings.catch_warnings():
    warnings.filterwarnings("ignore", message="pkg_resources is deprecated", category=UserWarning)
    import pygame

__all__ = ["NoDisplayError", "init_events", "open_display", "pygame"]

_INVISIBLE = frozenset(("offscreen", "dummy", "evdev"))  # drivers of SDL that show nothing
_DRIVER = "SDL_VIDEODRIVER"


class NoDisplayError(Exception):
    """There is nothing to show a window on."""


def open_display() -> None:
    """Starts SDL's video system for a window that somebody is to see.

    Without a display SDL falls back on a driver that draws nowhere; whoever wants that one names it in
    `SDL_VIDEODRIVER`.

    Raises:
        NoDisplayError: there is no display.
    """
    wanted = os.environ.get(_DRIVER, "")
    invisible = _INVISIBLE.difference(wanted.split(","))
    if pygame.display.get_init() and pygame.display.get_driver() in invisible:
        pygame.display.quit()  # as `init_events` left it
    # Without the folder of its sockets libwayland complains on stderr, and there is no such display.
    without_wayland = sys.platform == "linux" and not os.environ.get("XDG_RUNTIME_DIR")
    try:
        with _driver("x11,kmsdrm" if without_wayland and not wanted else None):
            pygame.display.init()
        driver = pygame.display.get_driver()
    except pygame.error as error:
        raise NoDisplayError(str(error) if wanted else _why_invisible(str(error))) from None
    if driver in invisible:
        pygame.display.quit()
        raise NoDisplayError(_why_invisible(f"SDL offers nothing but its driver {driver!r}"))


def init_events(window: bool = False) -> None:
    """Starts what delivers the events of joysticks, SDL's video system; needs no display.

    Args:
        window: open a window that nobody sees, for what needs one.
    """
    if not pygame.display.get_init():
        named = os.environ.get(_DRIVER) or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        with _driver("dummy" if window or (sys.platform == "linux" and not named) else None):
            pygame.display.init()
    if window:
        pygame.display.set_mode((64, 64))


@contextmanager
def _driver(name: str | None) -> Iterator[None]:
    """SDL's choice of a driver for as long as it takes; a later window of this process makes its own."""
    before = os.environ.get(_DRIVER)
    if name is not None:
        os.environ[_DRIVER] = name
    try:
        yield
    finally:
        if name is not None:
            os.environ.pop(_DRIVER)
            if before is not None:
                os.environ[_DRIVER] = before


def _why_invisible(otherwise: str) -> str:
    if sys.platform != "linux":
        return otherwise
    named = [f"{name}={os.environ[name]}" for name in ("WAYLAND_DISPLAY", "DISPLAY") if os.environ.get(name)]
    return f"no answer from {' and '.join(named)}" if named else "neither DISPLAY nor WAYLAND_DISPLAY is set"
