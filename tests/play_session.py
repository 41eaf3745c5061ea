"""What the tests of `copolicy-collect play` share: settings, a short map, and a thread that plays."""

import math
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from virtual_joystick import VirtualJoystick

from copolicy.collect.play.application import Application
from copolicy.collect.play.settings import PlayerSpec, PlaySettings
from copolicy.collect.session import BalancedSchedule
from copolicy.collect.ticker import MonotonicClock
from copolicy.tasks.table.map_config import MapConfig

SHORT_MAP = MapConfig(start=(760.0, 300.0, 3.14), goal=(960.0, 300.0))
"""Straight ahead, two and a half seconds away."""

A, B, X, Y, START = 0, 1, 2, 3, 7
"""Buttons of a gamepad."""


def settings(tmp_path: Path, **changes: Any) -> PlaySettings:
    """A session of two joysticks without waiting."""
    values: dict[str, Any] = {
        "pair": "P01",
        "out": tmp_path / "recordings",
        "players": (PlayerSpec("joystick"), PlayerSpec("joystick")),
        "episodes": 4,
        "config_folder": tmp_path / "config",
        "window": (400, 320),
        "mute": True,
        "countdown_s": 0.0,
    }
    return PlaySettings(**(values | changes))


def on_short_map(application: Application) -> None:
    """Puts every episode of a session on the short map."""
    game = application.game
    game.scenarios = (SHORT_MAP,)
    game.schedule = BalancedSchedule(
        game.scenarios, game.settings.episodes, game.settings.seed, game.settings.pair, swap=False
    )


class SimulatedClock(MonotonicClock):
    """A clock that stands still while a thread works, and moves on once all that follow it wait.

    It moves to the moment at which the first of them wakes, and wakes that one alone: what happens is the same
    whatever the machine is busy with, in the order in which it would happen on an idle one.
    """

    def __init__(self, threads: int = 1):
        """
        Args:
            threads: that follow it; each says when it no longer does.
        """
        self._now = time.monotonic_ns()
        self._threads = threads
        self._wakes: set[int] = set()
        self._moved = threading.Condition()

    def __call__(self) -> int:
        return self._now

    def sleep(self, seconds: float) -> None:
        with self._moved:
            wake = self._now + max(1, round(seconds * 1e9))
            while wake in self._wakes:
                wake += 1
            self._wakes.add(wake)
            self._move()
            while wake in self._wakes:
                if not self._moved.wait(60):
                    raise AssertionError("waited a minute for a thread that neither works on nor waits")

    def leave(self) -> None:
        """The calling thread follows it no longer."""
        with self._moved:
            self._threads -= 1
            self._move()

    def _move(self) -> None:
        if self._wakes and len(self._wakes) >= self._threads:
            self._now = min(self._wakes)
            self._wakes.remove(self._now)
            self._moved.notify_all()


class Players(threading.Thread):
    """A thread that does what two people do, while the program runs in the main one.

    Both follow the clock of the session. An error in the thread ends the session; `finish` raises it again.
    """

    def __init__(self, application: Application, play: Callable[["Players"], None]):
        super().__init__(daemon=True)
        self.clock = application.game.clock
        self.application = application
        self._play = play
        self._error: BaseException | None = None

    def run(self) -> None:
        try:
            self._play(self)
        except BaseException as error:
            self._error = error
        finally:
            self.application.game.stop = self.application.game.stop or "the players went home"
            self._leave()

    def finish(self) -> None:
        """Waits for the thread, and raises what went wrong in it."""
        self._leave()
        self.join(30)
        if self._error is not None:
            raise self._error

    def _leave(self) -> None:
        if isinstance(self.clock, SimulatedClock):
            self.clock.leave()

    def sleep(self, seconds: float) -> None:
        """Waits by the clock of the session."""
        self.clock.sleep(seconds)

    def until(self, condition: Callable[[], object], what: str, seconds: float = 15.0) -> None:
        """Waits for something to come true."""
        limit = self.clock() + seconds * 1e9
        while not condition():
            if self.clock() > limit:
                raise AssertionError(f"waited {seconds} s for {what}, in phase {type(self.application.phase).__name__}")
            self.sleep(0.005)

    def phase(self, name: str) -> None:
        """Waits for a phase."""
        self.until(lambda: type(self.application.phase).__name__ == name, name)

    def press(self, gamepad: VirtualJoystick, button: int) -> None:
        """Presses a button as a person does, and lets the program see it."""
        self.until(lambda: gamepad.is_open, "an open joystick")
        gamepad.button(button, True)
        self.sleep(0.08)
        gamepad.button(button, False)
        self.sleep(0.08)

    def carry(self, *gamepads: VirtualJoystick, steps: int | None = None) -> None:
        """Pushes with both sticks towards the goal, for a number of steps or until the episode ends."""
        game = self.application.game
        trial = game.trial
        assert trial is not None
        last = trial.steps + (steps or 10**6)
        limit = self.clock() + 40e9
        while trial.steps < last and not trial.outcome.done and self.clock() < limit:
            x, y, _ = trial.world.pose
            dx, dy = trial.scenario.goal[0] - x, trial.scenario.goal[1] - y
            for gamepad in gamepads:
                gamepad.move(dx / math.hypot(dx, dy), dy / math.hypot(dx, dy))
            self.sleep(0.01)
        for gamepad in gamepads:
            gamepad.move(0.0, 0.0)

    def result(self) -> None:
        """Waits for the result, and until it listens."""
        self.phase("ResultPhase")
        self.sleep(0.5)
