"""Before an episode: a preview with the seats of the players, and the count-down."""

import math
from typing import ClassVar

from ..inputs import Command, Press
from ..screen import Canvas
from ..screen.dialogs import STRIP_ROWS, draw_countdown, draw_strip_menu
from ..screen.palette import MUTED, YELLOW
from ..ticker import Tick
from .game import Game
from .menu_phase import MenuPhase
from .phase import NextPhase, Phase
from .player import SeatedPlayer

_UNATTENDED_S = 1.0  # a session without people then starts by itself


class Ready(MenuPhase):
    """Shows the next episode until a player starts it."""

    shortcuts: ClassVar = {Command.SWAP: "swap", Command.UNDO: "undo", Command.PAUSE: "quit?"}

    def __init__(self, game: Game):
        items = [("start", "start"), ("back to the lobby", "lobby"), ("quit for now", "quit")]
        items[1:1] = [("swap seats", "swap")] * game.settings.may_exchange_seats
        super().__init__(game, "", items, STRIP_ROWS)

    def enter(self) -> None:
        """Prepares the episode."""
        game = self.game
        game.next_trial()
        if game.folder.kept_recordings:
            self.top.items.insert(-2, ("undo the last keep", "undo"))

    def handle(self, press: Press) -> None:
        """Chooses by a shortcut, even one that the menu lacks, or moves in the menu."""
        self._choice = self.shortcuts.get(press.command) or self.top.handle(press) or self._choice

    def tick(self, tick: Tick) -> NextPhase:
        """Follows the players' choice; a session without people or a window starts by itself."""
        game = self.game
        self.ticks += 1
        choice = self.pop_choice()
        if self.unattended(_UNATTENDED_S) or game.settings.headless:
            choice = "start"
        match choice:
            case "start" if not game.roster.without_device():
                return NextPhase.COUNTDOWN
            case "start":
                game.show_message(f"{game.roster.without_device()[0].player_id}: press any button to join")
            case "swap":
                game.exchange_seats()
            case "undo":
                game.undo()
                game.next_trial()
            case "lobby":
                return NextPhase.LOBBY
            case "quit":
                game.stop = "quit"
                return NextPhase.END
            case "quit?":
                self.top.cursor = len(self.top.items) - 1
        return NextPhase.STAY

    def device_lost(self, player: SeatedPlayer) -> None:
        """Shows a message; the player has to join again."""
        self.game.show_message(f"{player.player_id}: device lost, press any button to join")

    def draw(self, canvas: Canvas, fraction: float) -> None:
        """Draws the world, and below it the seats and the menu, so that nothing hides the world."""
        game, trial = self.game, self.trial
        self.draw_world(canvas, trial, running=False)
        missing = game.roster.without_device()
        if missing:
            hint, colour = f"{missing[0].player_id}: press any button to join", YELLOW
        else:
            buttons = [labels["a"] for labels in game.roster.labels()]
            hint, colour = f"{' or '.join([*buttons, 'Enter'])} starts", MUTED
        draw_strip_menu(canvas, self.top.labels, self.top.cursor, hint, colour)


class Countdown(Phase):
    """Counts down before an episode begins or continues."""

    def __init__(self, game: Game):
        super().__init__(game)
        self._end_ns = game.clock() + round(game.settings.countdown_s * 1e9)
        self._last_number = 0
        self._pause = ""

    @property
    def _remaining_s(self) -> float:
        return (self._end_ns - self.game.clock()) / 1e9

    def handle(self, press: Press) -> None:
        """Pauses."""
        if press.command == Command.PAUSE:
            self._pause = "player"

    def device_lost(self, player: SeatedPlayer) -> None:
        """Pauses, since a player lacks a device."""
        self._pause = "device_lost"

    def focus_lost(self) -> None:
        """Pauses, since keys go to another window."""
        self._pause = "focus_lost"

    def tick(self, tick: Tick) -> NextPhase:
        """Plays a tone for each second; leads to the episode at zero."""
        if self._pause:
            self.game.pause_reason = self._pause
            return NextPhase.PAUSED
        number = math.ceil(self._remaining_s)
        if self._remaining_s <= 0:
            self.game.sounds.play("go")
            return NextPhase.RUNNING
        if number != self._last_number:
            self._last_number = number
            self.game.sounds.play("count")
        return NextPhase.STAY

    def draw(self, canvas: Canvas, fraction: float) -> None:
        """Draws the number below the world."""
        self.draw_world(canvas, self.trial, running=False)
        remaining = max(0.0, self._remaining_s)
        draw_countdown(canvas, str(max(1, math.ceil(remaining))), 1 - remaining % 1)
