"""The end of an episode: how it went, and what is to become of its recording."""

from ..inputs import Command, Press
from ..screen import SIZE, Canvas
from ..screen.dialogs import Line, draw_dialog, draw_entry, outcome_colour, outcome_text
from ..screen.outline_view import outline_of
from ..screen.palette import MUTED, YELLOW
from ..ticker import Tick
from .game import Game
from .menu import BACK, Menu, TextEntry, note_menu, reason_menu
from .phase import Phase, To

_LEFT = 310.0
_ALONE_S = 1.5  # without people the result stands for so long
_DEAF_TICKS = 12  # a button that was meant for the episode is no verdict


class Result(Phase):
    """Waits for the verdict: keep, redo, discard with a reason; notes before it, the last keep undone."""

    def __init__(self, game: Game):
        super().__init__(game)
        trial = self.trial
        self._ticks = 0
        self._choice = ""
        if trial.practice:
            items = [("go on", "keep"), ("once more", "redo"), ("quit for now", "quit")]
        else:
            items = [
                ("keep", "keep"),
                ("redo now", "redo"),
                ("discard: comes again later", "discard"),
                ("add a note", "note"),
                ("keep, and quit for now", "quit"),
            ]
            if game.folder.kept:
                items.insert(4, ("undo the keep before", "undo"))
        title = outcome_text(trial.outcome.reason)
        self._top = Menu(title[:1].upper() + title[1:], items)
        self._menus = [self._top]

    def handle(self, press: Press) -> None:
        """Moves in the menu, or takes a short cut."""
        if self._ticks < _DEAF_TICKS:
            return
        shortcuts = {
            Command.KEEP: "keep",
            Command.REDO: "redo",
            Command.DISCARD: "discard",
            Command.NOTE: "note",
            Command.UNDO: "undo",
        }
        choice = shortcuts.get(press.command)
        if choice is None or choice not in [value for _, value in self._menus[-1].items]:
            choice = self._menus[-1].handle(press)
        self._choice = choice or self._choice

    def tick(self, tick: Tick) -> To:
        """Follows the players' choice; without people, or without a window, every episode is kept."""
        game = self.game
        self._ticks += 1
        alone = not any(player.person for player in game.players) and self._ticks * game.ticker.dt_ns > _ALONE_S * 1e9
        if alone or game.settings.headless:
            self._choice = "keep"
        if self.entry and (self.entry.done or self.entry.left):
            if self.entry.done and self.entry.text.strip():
                self._note(self.entry.text.strip())
            self.entry = None
        choice, self._choice = self._choice, ""
        try:
            return self._follow(choice) if choice else To.STAY
        except OSError as error:
            game.lose_trial(error)
            return To.FAILURE

    def _follow(self, choice: str) -> To:
        game = self.game
        kind, _, detail = choice.partition(":")
        match kind:
            case "keep" | "redo":
                game.close_trial(kind, "redo" if kind == "redo" else "")
            case "discard" if not detail:
                self._menus.append(reason_menu())
                return To.STAY
            case "discard":
                game.close_trial("discard", detail)
            case "note" if not detail:
                self._menus.append(note_menu())
                return To.STAY
            case "note":
                self._note(detail)
                return To.STAY
            case "write":
                self.entry = TextEntry("Note (no names)")
                self._menus = [self._top]
                return To.STAY
            case "undo":
                game.undo()
                return To.STAY
            case "quit":
                game.stop = "quit"
                return To.END
            case _:
                if choice == BACK and len(self._menus) > 1:
                    self._menus.pop()
                return To.STAY
        return To.FINISHED if game.finished else To.READY

    def draw(self, canvas: Canvas, share: float) -> None:
        """Draws the result over the world."""
        trial = self.trial
        self.draw_world(canvas, trial)
        if self.entry:
            draw_entry(canvas, self.entry.title, self.entry.text)
            return
        menu = self._menus[-1]
        lines = [Line(f"{trial.seconds:.1f} s,  score {trial.score:+.0f}", 34)]
        if trial.loop.slow:
            lines.append(Line(f"the loop was too slow ({trial.loop.skipped} skipped ticks): flagged", 24, YELLOW))
        if trial.notes:
            lines.append(Line(f"notes: {'; '.join(trial.notes)}", 24, MUTED))
        hint = ""
        if menu is self._top and not trial.practice:
            hint = self.game.roster.hint(("a", "K", "keep"), ("x", "R", "redo"), ("y", "X", "discard"))
        colour = outcome_colour(trial.task.spec, trial.outcome.reason)
        # Beside the body, so that everybody sees what happened.
        middle = _LEFT if trial.pose[0] > outline_of(trial.task).size[0] / 2 else SIZE[0] - _LEFT
        draw_dialog(canvas, menu.title, lines, menu.labels, menu.cursor, colour, 560, hint, middle)

    def _note(self, text: str) -> None:
        self.trial.note(text)
        self._menus = [self._top]
        self.game.say("note added")
