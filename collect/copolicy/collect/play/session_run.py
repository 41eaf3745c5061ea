"""`copolicy-collect play`: opens the window, loads the session, runs it and closes everything."""

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


def play(settings: PlaySettings) -> dict[str, Any]:
    """Runs a session until it is complete or ended by a player or a signal.

    Returns:
        Counts of the recorded episodes, JSON-able.

    Raises:
        CopolicyError: settings, files or devices cannot be used, another tool collects into the folder, or, without a
            window, the disk cannot be written to.
    """
    with prepared(settings) as application:
        with stopped_by_signals(application.game):
            application.run()
        return application.summary()


@contextmanager
def prepared(
    settings: PlaySettings,
    load: tuple[str, Callable[[], Any]] | None = None,
    clock: MonotonicClock | None = None,
) -> Iterator[Application]:
    """Opens the window, then folder, devices and players; closes them when the block is left.

    Args:
        settings: of the session.
        load: a further job to run while the window is open, with a name for the screen.
        clock: of the session; by default the machine's.

    Raises:
        CopolicyError: there is no display, or as for `play`.
    """
    task = get_task(settings.task)
    with ExitStack() as stack:
        window = None
        if settings.headless:
            init_events(window=True)
        else:
            window = Window(settings.window, settings.fullscreen, task.words.invitation or task.spec.title)
            pygame.mouse.set_visible(False)
        stack.callback(pygame.display.quit)
        stack.callback(pygame.joystick.quit)
        loading = Loading(window)
        # Imported after the window is open, since the modules of world, recorder and routes take seconds to load.
        assembly = loading.run(
            f"the task {settings.task} and the recorder", lambda: import_module(".assembly", __package__)
        )
        if load is not None:
            loading.run(*load)
        application = assembly.assemble(settings, window, loading, stack, clock)
        if window is not None:
            window.loaded()
        game = application.game
        gc.collect()
        gc.freeze()
        stack.callback(gc.unfreeze)
        stack.callback(gc.enable)
        # By default a thread that runs a policy may block the loop for 5 ms.
        stack.callback(sys.setswitchinterval, sys.getswitchinterval())
        sys.setswitchinterval(0.0005)
        yield application
        game.folder.journal("end", reason=game.stop or "end")


@contextmanager
def stopped_by_signals(game: Game) -> Iterator[None]:
    """Makes SIGTERM and Ctrl-C end the session; the recording of a running episode is completed."""
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
