"""A pause: why, and how to go on."""

from ..inputs import Command, Press
from ..screen import Canvas
from ..screen.dialogs import Line, draw_dialog, draw_entry
from ..screen.palette import MUTED, VERMILION, YELLOW
from ..ticker import Tick
from .game import Game
from .menu import BACK, Menu, TextEntry, note_menu, reason_menu
from .phase import Phase, To
from .player import Player

_WHY = {
    "player": "Pause",
    "device_lost": "A joystick was unplugged",
    "focus_lost": "Another window came to the front",
}


class Paused(Phase):
    """Waits; the episode goes on after a count-down, with everybody's device in hand."""

    def __init__(self, game: Game):
        super().__init__(game)
        self._reason = reason = game.pause_reason
        self._choice = ""
        self._events: list[tuple[str, str]] = []
        self._top = Menu(
            _WHY[reason],
            [
                ("go on", "resume"),
                ("add a note", "note"),
                ("redo this episode", "redo"),
                ("discard this episode", "discard"),
                ("quit for now", "quit"),
            ],
        )
        self._menus = [self._top]
        if not self.trial.began:
            self._top.items = [("go on", "resume"), ("quit for now", "quit")]

    def enter(self) -> None:
        """Tells why."""
        self.game.sounds.play("choose" if self._reason == "player" else "alarm")

    def handle(self, press: Press) -> None:
        """Moves in the menu, or goes on."""
        shortcuts = {Command.NOTE: "note", Command.REDO: "redo", Command.DISCARD: "discard", Command.PAUSE: "resume"}
        choice = shortcuts.get(press.command)
        if press.moved and self._reason == "device_lost" and self.game.roster.missing():
            return
        if choice is None or choice not in [value for _, value in self._menus[-1].items]:
            choice = self._menus[-1].handle(press)
        self._choice = choice or self._choice

    def device_lost(self, player: Player) -> None:
        """One more reason to wait."""
        self._events.append(("device_lost", player.player_id))
        self._reason = "device_lost"
        self._top.title = _WHY[self._reason]

    def tick(self, tick: Tick) -> To:
        """Follows the players' choice."""
        game = self.game
        if game.settings.headless and not game.roster.missing():
            self._choice = "resume"
        if self.entry and (self.entry.done or self.entry.left):
            if self.entry.done and self.entry.text.strip():
                self._note(self.entry.text.strip())
            self.entry = None
        choice, self._choice = self._choice, ""
        try:
            while self._events:
                self.trial.event(*self._events.pop(0))
            return self._follow(choice) if choice else To.STAY
        except OSError as error:
            game.lose_trial(error)
            return To.FAILURE

    def _follow(self, choice: str) -> To:
        game = self.game
        kind, _, detail = choice.partition(":")
        match kind:
            case "resume" if game.roster.missing():
                game.say(f"{game.roster.missing()[0].player_id}: press any button to join")
            case "resume":
                return To.COUNTDOWN
            case "note" if not detail:
                self._menus.append(note_menu())
            case "note":
                self._note(detail)
            case "write":
                self.entry = TextEntry("Note (no names)")
                self._menus = [self._top]
            case "discard" if not detail:
                self._menus.append(reason_menu())
            case "redo" | "discard":
                game.close_trial(kind, detail or "redo")
                return To.READY
            case "quit":
                game.stop = self._reason if self._reason in ("device_lost", "focus_lost") else "quit"
                return To.END
            case _ if choice == BACK and len(self._menus) > 1:
                self._menus.pop()
        return To.STAY

    def draw(self, canvas: Canvas, share: float) -> None:
        """Draws the menu over the world."""
        self.draw_world(canvas, self.trial)
        canvas.dim()
        if self.entry:
            draw_entry(canvas, self.entry.title, self.entry.text)
            return
        menu = self._menus[-1]
        lines = []
        for player in self.game.roster.missing():
            lines.append(Line(f"{player.player_id}: plug it in and press any button to join", 28, YELLOW))
        if self.trial.notes:
            lines.append(Line(f"notes: {'; '.join(self.trial.notes)}", 24, MUTED))
        colour = VERMILION if self._reason == "device_lost" and self.game.roster.missing() else YELLOW
        draw_dialog(canvas, menu.title, lines, menu.labels, menu.cursor, colour)

    def _note(self, text: str) -> None:
        self.trial.note(text)
        self._menus = [self._top]
        self.game.say("note added")
