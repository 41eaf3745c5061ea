"""`copolicy-collect play`: opens the window, loads everything else, runs the session, closes everything in order."""

from __future__ import annotations

import gc
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from typing import TYPE_CHECKING, Any

from copolicy.dataset.task import get_task

from ..screen.window import Window
from ..sdl import init_events, pygame
from .loading import Loading
from .settings import PlaySettings

if TYPE_CHECKING:
    from ..ticker import MonotonicClock
    from .application import Application
    from .game import Game


def play(settings: PlaySettings) -> dict:
    """Runs a session until it is complete or somebody ends it.

    Returns:
        What was recorded, JSON-able.

    Raises:
        CopolicyError: settings, files or devices that cannot be used, a folder that another tool collects into, or a
            disk that cannot be written to where nobody can be asked.
    """
    with prepared(settings) as application:
        with stopped_by_signals(application.game):
            application.run()
        return application.summary()


@contextmanager
def prepared(
    settings: PlaySettings,
    also: tuple[str, Callable[[], Any]] | None = None,
    clock: MonotonicClock | None = None,
) -> Iterator[Application]:
    """Opens the window, then folder, devices and players; closes them however the block is left.

    Args:
        also: a further job and what it loads, to be run while the window shows that.
        clock: what the session follows; by default the machine's.

    Raises:
        CopolicyError: there is no display, or see `play`.
    """
    task = get_task(settings.task)
    with ExitStack() as stack:
        window = None
        if settings.headless:
            init_events(window=True)
        else:
            window = Window(settings.window, settings.fullscreen, task.words.invitation or task.spec.title)
            pygame.mouse.set_visible(False)
        stack.callback(_close_pygame)
        loading = Loading(window)
        # By name and not at the top: people look at the window while world, recorder and routes are imported.
        assembly = loading.run(f"the {settings.task} and its recorder", lambda: import_module(".assembly", __package__))
        if also is not None:
            loading.run(*also)
        application = assembly.assemble(settings, window, loading, stack, clock)
        if window is not None:
            window.loaded()
        game = application.game
        gc.collect()
        gc.freeze()
        stack.callback(gc.unfreeze)
        stack.callback(gc.enable)
        # A thread that plans must not hold the loop for Python's usual 5 ms.
        stack.callback(sys.setswitchinterval, sys.getswitchinterval())
        sys.setswitchinterval(0.0005)
        yield application
        game.folder.journal("end", reason=game.stop or "end")


@contextmanager
def stopped_by_signals(game: Game) -> Iterator[None]:
    """SIGTERM and Ctrl-C end the session in order: the running episode is completed up to its last step."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: object) -> None:
        game.stop = game.stop or signal.Signals(number).name

    before = {number: signal.signal(number, stop) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _close_pygame() -> None:
    pygame.joystick.quit()
    pygame.display.quit()
