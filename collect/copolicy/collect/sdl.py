"""Imports pygame without output, with the environment variables that must be set before its import.

Use `from .sdl import pygame` instead of `import pygame`, which prints a greeting on stdout, where `--json` prints one
object; pygame 2.6 also warns about a package of setuptools.
"""

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
# SDL drops the input of all joysticks while its window lacks the keyboard focus, and without a window there is no
# focus. The episode is paused anyway when the focus is lost.
os.environ.setdefault("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")
os.environ.setdefault("SDL_WINDOWS_DPI_AWARENESS", "permonitorv2")

with warnings.catch_warnings():
    warnings.filterwarnings("ignore", message="pkg_resources is deprecated", category=UserWarning)
    import pygame

__all__ = ["NoDisplayError", "init_events", "open_display", "pygame"]

_INVISIBLE = frozenset(("offscreen", "dummy", "evdev"))  # drivers of SDL that show nothing
_DRIVER = "SDL_VIDEODRIVER"


class NoDisplayError(Exception):
    """There is no display for a window."""


def open_display() -> None:
    """Starts SDL's video system for a visible window.

    Without a display SDL would fall back on a driver that draws nowhere; this is an error, unless `SDL_VIDEODRIVER`
    names such a driver.

    Raises:
        NoDisplayError: there is no display.
    """
    requested = os.environ.get(_DRIVER, "")
    invisible = _INVISIBLE.difference(requested.split(","))
    if pygame.display.get_init() and pygame.display.get_driver() in invisible:
        pygame.display.quit()  # started by `init_events`
    # Without the folder of its sockets libwayland prints errors on stderr, and there is no Wayland display.
    without_wayland = sys.platform == "linux" and not os.environ.get("XDG_RUNTIME_DIR")
    try:
        with _driver("x11,kmsdrm" if without_wayland and not requested else None):
            pygame.display.init()
        driver = pygame.display.get_driver()
    except pygame.error as error:
        raise NoDisplayError(str(error) if requested else _no_display_reason(str(error))) from None
    if driver in invisible:
        pygame.display.quit()
        raise NoDisplayError(_no_display_reason(f"SDL offers only its driver {driver!r}"))


def init_events(window: bool = False) -> None:
    """Starts SDL's video system, which delivers the events of joysticks; needs no display.

    Args:
        window: open an invisible window, for functions that need one.
    """
    if not pygame.display.get_init():
        display = os.environ.get(_DRIVER) or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        with _driver("dummy" if window or (sys.platform == "linux" and not display) else None):
            pygame.display.init()
    if window:
        pygame.display.set_mode((64, 64))


@contextmanager
def _driver(name: str | None) -> Iterator[None]:
    """Sets SDL's video driver for the duration of the block, so that a later window of this process can use another."""
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


def _no_display_reason(default: str) -> str:
    if sys.platform != "linux":
        return default
    displays = [f"{name}={os.environ[name]}" for name in ("WAYLAND_DISPLAY", "DISPLAY") if os.environ.get(name)]
    return f"no answer from {' and '.join(displays)}" if displays else "neither DISPLAY nor WAYLAND_DISPLAY is set"
