"""A pause: why, and how to go on."""

from typing import ClassVar

from ..inputs import Command, Press
from ..screen import Canvas
from ..screen.dialogs import Line, draw_dialog, draw_entry
from ..screen.palette import MUTED, VERMILION, YELLOW
from ..ticker import Tick
from .game import Game
from .menu_phase import NotesPhase
from .phase import To
from .player import Player

_WHY = {
    "player": "Pause",
    "device_lost": "A joystick was unplugged",
    "focus_lost": "Another window came to the front",
}


class Paused(NotesPhase):
    """Waits; the episode goes on after a count-down, with everybody's device in hand."""

    shortcuts: ClassVar = {
        Command.NOTE: "note",
        Command.REDO: "redo",
        Command.DISCARD: "discard",
        Command.PAUSE: "resume",
    }

    def __init__(self, game: Game):
        self._reason = game.pause_reason
        self._events: list[tuple[str, str]] = []
        items = [("go on", "resume"), ("quit for now", "quit")]
        if game.trial is not None and game.trial.began:
            items[1:1] = [("add a note", "note"), ("redo this episode", "redo"), ("discard this episode", "discard")]
        super().__init__(game, _WHY[self._reason], items)

    def enter(self) -> None:
        """Tells why."""
        self.game.sounds.play("choose" if self._reason == "player" else "alarm")

    def handle(self, press: Press) -> None:
        """Moves in the menu, or goes on."""
        if not (press.moved and self._reason == "device_lost" and self.game.roster.missing()):
            super().handle(press)

    def device_lost(self, player: Player) -> None:
        """One more reason to wait."""
        self._events.append(("device_lost", player.player_id))
        self._reason = "device_lost"
        self.top.title = _WHY[self._reason]

    def tick(self, tick: Tick) -> To:
        """Follows the players' choice."""
        game = self.game
        if game.settings.headless and not game.roster.missing():
            self._choice = "resume"
        try:
            while self._events:
                self.trial.event(*self._events.pop(0))
        except OSError as error:
            game.lose_trial(error)
            return To.FAILURE
        return self.tick_notes()

    def follow(self, choice: str) -> To:
        """Goes on, or ends the episode."""
        game = self.game
        kind, _, detail = choice.partition(":")
        match kind:
            case "resume" if game.roster.missing():
                game.say(f"{game.roster.missing()[0].player_id}: press any button to join")
                return To.STAY
            case "resume":
                return To.COUNTDOWN
            case "redo" | "discard" if detail or kind == "redo":
                game.close_trial(kind, detail or "redo")
                return To.READY
            case "quit":
                game.stop = self._reason if self._reason in ("device_lost", "focus_lost") else "quit"
                return To.END
        return super().follow(choice)

    def draw(self, canvas: Canvas, share: float) -> None:
        """Draws the menu over the world."""
        self.draw_world(canvas, self.trial)
        canvas.dim()
        if self.entry:
            draw_entry(canvas, self.entry.title, self.entry.text)
            return
        missing, menu = self.game.roster.missing(), self.menu
        lines = [Line(f"{player.player_id}: plug it in and press any button to join", 28, YELLOW) for player in missing]
        if self.trial.notes:
            lines.append(Line(f"notes: {'; '.join(self.trial.notes)}", 24, MUTED))
        colour = VERMILION if self._reason == "device_lost" and missing else YELLOW
        draw_dialog(canvas, menu.title, lines, menu.labels, menu.cursor, colour)
