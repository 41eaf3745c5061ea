"""Before an episode: the map, who sits where, and the count-down."""

import math
from typing import ClassVar

from ..inputs import Command, Press
from ..screen import Canvas
from ..screen.dialogs import STRIP_ROWS, draw_countdown, draw_strip_menu
from ..screen.palette import MUTED, YELLOW
from ..ticker import Tick
from .game import Game
from .menu_phase import MenuPhase
from .phase import Phase, To
from .player import Player

_LIMB_S = 1.0  # a session without people moves on by itself


class Ready(MenuPhase):
    """Shows the episode that is about to begin; either player starts it."""

    shortcuts: ClassVar = {Command.SWAP: "swap", Command.UNDO: "undo", Command.PAUSE: "quit?"}

    def __init__(self, game: Game):
        items = [("start", "start"), ("swap seats", "swap"), ("sticks and consent", "lobby"), ("quit for now", "quit")]
        super().__init__(game, "", items, STRIP_ROWS)

    def enter(self) -> None:
        """Prepares the episode."""
        game = self.game
        game.next_trial()
        if game.folder.kept:
            self.top.items.insert(2, ("undo the last keep", "undo"))

    def handle(self, press: Press) -> None:
        """Starts, or does what the menu offers; a short cut does so whatever the menu offers."""
        self._choice = self.shortcuts.get(press.command) or self.top.handle(press) or self._choice

    def tick(self, tick: Tick) -> To:
        """Follows the players' choice; a session without people needs none."""
        game = self.game
        self.ticks += 1
        choice = self.take()
        if self.alone(_LIMB_S) or game.settings.headless:
            choice = "start"
        match choice:
            case "start" if not game.roster.missing():
                return To.COUNTDOWN
            case "start":
                game.say(f"{game.roster.missing()[0].player_id} has no device")
            case "swap":
                game.reseat()
            case "undo":
                game.undo()
                game.next_trial()
            case "lobby":
                return To.LOBBY
            case "quit":
                game.stop = "quit"
                return To.END
            case "quit?":
                self.top.cursor = len(self.top.items) - 1
        return To.STAY

    def device_lost(self, player: Player) -> None:
        """They have to join again."""
        self.game.say(f"{player.player_id} lost their device")

    def draw(self, canvas: Canvas, share: float) -> None:
        """Draws the map, and below it who sits where and the menu: people study the map now."""
        game, trial = self.game, self.trial
        self.draw_world(canvas, trial, carrying=False)
        missing = game.roster.missing()
        if missing:
            hint, colour = f"{missing[0].player_id}: press any button to join", YELLOW
        else:
            buttons = [labels["a"] for labels in game.roster.labels()]
            hint, colour = f"{' or '.join([*buttons, 'Enter'])} starts", MUTED
        draw_strip_menu(canvas, self.top.labels, self.top.cursor, hint, colour)


class Countdown(Phase):
    """Three, two, one; then the episode begins or goes on."""

    def __init__(self, game: Game):
        super().__init__(game)
        self._end_ns = game.clock() + round(game.settings.countdown_s * 1e9)
        self._told = 0
        self._stop = ""

    @property
    def _left_s(self) -> float:
        return (self._end_ns - self.game.clock()) / 1e9

    def handle(self, press: Press) -> None:
        """Somebody is not ready after all."""
        if press.command == Command.PAUSE:
            self._stop = "player"

    def device_lost(self, player: Player) -> None:
        """Nothing begins without a device."""
        self._stop = "device_lost"

    def focus_lost(self) -> None:
        """Nothing begins behind another window."""
        self._stop = "focus_lost"

    def tick(self, tick: Tick) -> To:
        """Counts."""
        if self._stop:
            self.game.pause_reason = self._stop
            return To.PAUSED
        number = math.ceil(self._left_s)
        if self._left_s <= 0:
            self.game.sounds.play("go")
            return To.RUNNING
        if number != self._told:
            self._told = number
            self.game.sounds.play("count")
        return To.STAY

    def draw(self, canvas: Canvas, share: float) -> None:
        """Draws the number below the world."""
        self.draw_world(canvas, self.trial, carrying=False)
        left = max(0.0, self._left_s)
        draw_countdown(canvas, str(max(1, math.ceil(left))), 1 - left % 1)
