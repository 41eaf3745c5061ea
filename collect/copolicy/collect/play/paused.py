"""The phase of a pause."""

from typing import ClassVar

from ..inputs import Command, Press
from ..screen import Canvas
from ..screen.dialogs import Line, draw_dialog, draw_entry
from ..screen.palette import MUTED, VERMILION, YELLOW
from ..ticker import Tick
from .game import Game
from .menu_phase import NotesPhase
from .phase import NextPhase
from .player import SeatedPlayer

_TITLES = {
    "player": "Paused",
    "device_lost": "Paused: a gamepad is missing",
    "focus_lost": "Paused: another window is in front",
}


class Paused(NotesPhase):
    """Waits for a choice; resuming needs a device for each person and leads to a count-down."""

    shortcuts: ClassVar = {
        Command.NOTE: "note",
        Command.REDO: "redo",
        Command.DISCARD: "discard",
        Command.PAUSE: "resume",
    }

    def __init__(self, game: Game):
        self._reason = game.pause_reason
        self._events: list[tuple[str, str]] = []
        items = [("continue", "resume"), ("quit for now", "quit")]
        if game.trial is not None and game.trial.began:
            items[1:1] = [("add a note", "note"), ("redo this episode", "redo"), ("discard this episode", "discard")]
        super().__init__(game, _TITLES[self._reason], items)

    def enter(self) -> None:
        """Plays a tone."""
        self.game.sounds.play("choose" if self._reason == "player" else "alarm")

    def handle(self, press: Press) -> None:
        """Moves in the menu or chooses; a stick does not move in it while a gamepad is missing."""
        if not (press.moved and self._reason == "device_lost" and self.game.roster.without_device()):
            super().handle(press)

    def device_lost(self, player: SeatedPlayer) -> None:
        """Shows that a device is missing, and records it."""
        self._events.append(("device_lost", player.player_id))
        self._reason = "device_lost"
        self.top.title = _TITLES[self._reason]

    def tick(self, tick: Tick) -> NextPhase:
        """Records events, then follows the players' choice; without a window it resumes by itself."""
        game = self.game
        if game.settings.headless and not game.roster.without_device():
            self._choice = "resume"
        try:
            while self._events:
                self.trial.event(*self._events.pop(0))
        except OSError as error:
            game.abandon_trial(error)
            return NextPhase.FAILURE
        return self.tick_notes()

    def follow(self, choice: str) -> NextPhase:
        """Resumes or ends the episode."""
        game = self.game
        action, _, detail = choice.partition(":")
        match action:
            case "resume" if game.roster.without_device():
                game.show_message(f"{game.roster.without_device()[0].player_id}: press any button to join")
                return NextPhase.STAY
            case "resume":
                return NextPhase.COUNTDOWN
            case "redo" | "discard" if detail or action == "redo":
                game.close_trial(action, detail or "redo")
                return NextPhase.READY
            case "quit":
                game.stop = self._reason if self._reason in ("device_lost", "focus_lost") else "quit"
                return NextPhase.END
        return super().follow(choice)

    def draw(self, canvas: Canvas, fraction: float) -> None:
        """Draws the menu over the world."""
        self.draw_world(canvas, self.trial)
        canvas.dim()
        if self.entry:
            draw_entry(canvas, self.entry.title, self.entry.text)
            return
        missing, menu = self.game.roster.without_device(), self.menu
        lines = [Line(f"{player.player_id}: plug it in and press any button", 28, YELLOW) for player in missing]
        if self.trial.notes:
            lines.append(Line(f"notes: {'; '.join(self.trial.notes)}", 24, MUTED))
        colour = VERMILION if self._reason == "device_lost" and missing else YELLOW
        draw_dialog(canvas, menu.title, lines, menu.labels, menu.cursor, colour)
