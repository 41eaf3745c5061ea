"""The loading screen: shows which part of a session is being loaded, and for how long."""

import threading
import time
from collections.abc import Callable
from typing import Any

from copolicy.dataset.exceptions import RunError

from ..screen import SIZE, Canvas
from ..screen.palette import MUTED, SKY, TEXT
from ..screen.window import Window
from ..sdl import pygame

_FRAME_S = 0.05
_FINISHED_LINES = 5


class Loading:
    """Runs jobs one after another in a thread, and shows the name of the current one.

    Without a window, jobs run in the calling thread.
    """

    def __init__(self, window: Window | None):
        self._window = window
        self._finished: list[str] = []

    def run[T](self, name: str, job: Callable[[], T]) -> T:
        """Runs a job and returns its result.

        Args:
            name: for the screen, a few words.
            job: must not use the window or the devices.

        Raises:
            RunError: the window was closed or the program told to stop; the job's thread is abandoned.
            Exception: raised by the job.
        """
        if self._window is None:
            return job()
        began = time.monotonic()
        self._draw(self._window, name, 0.0)
        outcome: dict[str, Any] = {}

        def work() -> None:
            try:
                outcome["result"] = job()
            except BaseException as error:
                outcome["error"] = error

        thread = threading.Thread(target=work, name=name, daemon=True)
        thread.start()
        while thread.is_alive():
            thread.join(_FRAME_S)
            if pygame.event.peek(pygame.QUIT):
                raise RunError("the session was ended before it began")
            pygame.event.pump()
            self._draw(self._window, name, time.monotonic() - began)
        if "error" in outcome:
            raise outcome["error"]
        self._finished.append(name)
        return outcome["result"]

    def _draw(self, window: Window, name: str, seconds: float) -> None:
        canvas = Canvas(window.surface)
        canvas.clear()
        canvas.text("copolicy", (600, 200), 84, TEXT, "center")
        canvas.text(f"loading {name}", (600, 330), 40, SKY, "center", 1100)
        # A moving bar, since the duration of an import is unknown.
        position = abs((seconds / 1.5) % 2 - 1)
        canvas.bar(400, 375, 400, 14, 0.0, SKY)
        x, y = 400 + 340 * position, 382
        with canvas.patch(x + 30, y, 40) as patch:
            patch.line(SKY, canvas.point(x + 7, y), canvas.point(x + 53, y), 14 * canvas.scale)
        if seconds >= 1:
            canvas.text(f"{seconds:.0f} s", (600, 420), 28, MUTED, "center")
        for row, finished in enumerate(self._finished[-_FINISHED_LINES:]):
            canvas.text(f"{finished}: done", (600, 490 + 34 * row), 26, MUTED, "center", 1100)
        canvas.text("close the window to cancel", (600, SIZE[1] - 22), 22, MUTED, "center")
        window.show()
