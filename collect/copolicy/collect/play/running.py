"""The episode itself."""

import gc

from copolicy.dataset.task_spec import TIMEOUT

from ..inputs import Command, Press
from ..screen import Canvas
from ..ticker import Tick
from .game import Game
from .phase import Phase, To
from .player import Player


class Running(Phase):
    """One step a tick until the episode ends or somebody pauses it."""

    realtime = True

    def __init__(self, game: Game):
        super().__init__(game)
        self._pause = ""
        self._events: list[tuple[str, str]] = []
        self._failed: OSError | None = None

    def enter(self) -> None:
        """Opens the recording, or goes on with it; the first step is due a whole step later."""
        trial, game = self.trial, self.game
        try:
            if trial.began:
                trial.resume()
            else:
                trial.begin(game.describe_devices(trial))
        except OSError as error:
            self._failed = error
        gc.collect()
        gc.disable()  # a collection in the middle of an episode would be a late tick
        game.ticker.restart()

    def handle(self, press: Press) -> None:
        """Pauses; everything else is far from the stick on purpose."""
        if press.command in (Command.PAUSE, Command.HELP):
            self._pause = self._pause or "player"

    def device_lost(self, player: Player) -> None:
        """Pauses: a device that is gone reads as zero force, which nobody meant."""
        self._events.append(("device_lost", player.player_id))
        self._pause = "device_lost"

    def focus_lost(self) -> None:
        """Pauses: keys go to another window."""
        self._events.append(("focus_lost", ""))
        self._pause = self._pause or "focus_lost"

    def tick(self, tick: Tick) -> To:
        """One step."""
        game, trial = self.game, self.trial
        try:
            if self._failed is not None:
                raise self._failed
            if self._pause:
                gc.enable()
                for event in self._events:
                    trial.event(*event)
                trial.pause(self._pause)
                game.pause_reason = self._pause
                return To.PAUSED
            trial.step(tick)
        except OSError as error:
            gc.enable()
            game.lose_trial(error)
            return To.FAILURE
        if not trial.outcome.done:
            return To.STAY
        gc.enable()
        timeout = trial.outcome.reason == TIMEOUT
        game.sounds.play("goal" if trial.outcome.success else TIMEOUT if timeout else "collision")
        return To.RESULT

    def draw(self, canvas: Canvas, share: float) -> None:
        """Draws the world between the last two steps."""
        self.draw_world(canvas, self.trial, share)
