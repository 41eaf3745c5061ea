"""The phase of a running episode."""

import gc

from copolicy.dataset.task_spec import TIMEOUT

from ..inputs import Command, Press
from ..screen import Canvas
from ..ticker import Tick
from .game import Game
from .phase import NextPhase, Phase
from .player import SeatedPlayer


class Running(Phase):
    """Makes one step a tick until the episode ends or is paused."""

    realtime = True

    def __init__(self, game: Game):
        super().__init__(game)
        self._pause = ""
        self._events: list[tuple[str, str]] = []
        self._open_error: OSError | None = None

    def enter(self) -> None:
        """Opens or resumes the recording; the first step is due one tick later."""
        trial, game = self.trial, self.game
        try:
            if trial.began:
                trial.resume()
            else:
                trial.begin(game.describe_devices(trial))
        except OSError as error:
            self._open_error = error
        gc.collect()
        gc.disable()  # a collection during an episode would make a tick late
        game.ticker.restart()

    def handle(self, press: Press) -> None:
        """Pauses; other commands have no effect during an episode."""
        if press.command in (Command.PAUSE, Command.HELP):
            self._pause = self._pause or "player"

    def device_lost(self, player: SeatedPlayer) -> None:
        """Pauses, since a device that is gone would read as zero force."""
        self._events.append(("device_lost", player.player_id))
        self._pause = "device_lost"

    def focus_lost(self) -> None:
        """Pauses, since keys go to another window."""
        self._events.append(("focus_lost", ""))
        self._pause = self._pause or "focus_lost"

    def tick(self, tick: Tick) -> NextPhase:
        """Makes one step, or records a pause."""
        game, trial = self.game, self.trial
        try:
            if self._open_error is not None:
                raise self._open_error
            if self._pause:
                gc.enable()
                for event in self._events:
                    trial.event(*event)
                trial.pause(self._pause)
                game.pause_reason = self._pause
                return NextPhase.PAUSED
            trial.step(tick)
        except OSError as error:
            gc.enable()
            game.abandon_trial(error)
            return NextPhase.FAILURE
        if not trial.outcome.done:
            return NextPhase.STAY
        gc.enable()
        timeout = trial.outcome.reason == TIMEOUT
        game.sounds.play("goal" if trial.outcome.success else TIMEOUT if timeout else "collision")
        return NextPhase.RESULT

    def draw(self, canvas: Canvas, fraction: float) -> None:
        """Draws the world between the last two steps."""
        self.draw_world(canvas, self.trial, fraction)
