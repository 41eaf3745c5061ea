"""The window while a session is being loaded: what takes so long, and for how long it has."""

import threading
import time
from collections.abc import Callable
from typing import Any

from copolicy.dataset.exceptions import RunError

from ..screen import SIZE, Canvas
from ..screen.palette import MUTED, SKY, TEXT
from ..screen.window import Window
from ..sdl import pygame

_PICTURE_S = 0.05
_LINES = 5  # of what is done already


class Loading:
    """Runs one job after the other in a thread of its own, and shows meanwhile what it is.

    Without a window jobs simply run.
    """

    def __init__(self, window: Window | None):
        self._window = window
        self._done: list[str] = []

    def run[Result](self, what: str, job: Callable[[], Result]) -> Result:
        """Runs a job and returns its result.

        Args:
            what: for the screen, in a few words.
            job: must leave the window and the devices alone.

        Raises:
            RunError: the window was closed meanwhile, or the program told to stop; nobody waits for the job any more.
            Exception: whatever the job raises.
        """
        if self._window is None:
            return job()
        began = time.monotonic()
        self._draw(self._window, what, 0.0)
        outcome: dict[str, Any] = {}

        def work() -> None:
            try:
                outcome["result"] = job()
            except BaseException as error:
                outcome["error"] = error

        thread = threading.Thread(target=work, name=what, daemon=True)
        thread.start()
        while thread.is_alive():
            thread.join(_PICTURE_S)
            if pygame.event.peek(pygame.QUIT):
                raise RunError("the session was ended before it began")
            pygame.event.pump()
            self._draw(self._window, what, time.monotonic() - began)
        if "error" in outcome:
            raise outcome["error"]
        self._done.append(what)
        return outcome["result"]

    def _draw(self, window: Window, what: str, seconds: float) -> None:
        canvas = Canvas(window.surface)
        canvas.clear()
        canvas.text("copolicy", (600, 200), 84, TEXT, "center")
        canvas.text(f"loading {what}", (600, 330), 40, SKY, "center", 1100)
        # It goes to and fro, since nobody knows how long an import takes.
        share = abs((seconds / 1.5) % 2 - 1)
        canvas.bar(400, 375, 400, 14, 0.0, SKY)
        x, y = 400 + 340 * share, 382
        with canvas.patch(x + 30, y, 40) as patch:
            patch.line(SKY, canvas.point(x + 7, y), canvas.point(x + 53, y), 14 * canvas.scale)
        if seconds >= 1:
            canvas.text(f"{seconds:.0f} s", (600, 420), 28, MUTED, "center")
        for row, done in enumerate(self._done[-_LINES:]):
            canvas.text(f"{done}: done", (600, 490 + 34 * row), 26, MUTED, "center", 1100)
        canvas.text("close the window to leave", (600, SIZE[1] - 22), 22, MUTED, "center")
        window.show()
