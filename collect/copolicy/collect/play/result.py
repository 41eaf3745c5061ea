"""The phase after an episode: shows its result and asks for a verdict."""

from typing import ClassVar

from ..inputs import Command, Press
from ..screen import SIZE, Canvas
from ..screen.dialogs import Line, draw_dialog, draw_entry, outcome_colour, outcome_text
from ..screen.palette import MUTED, YELLOW
from ..ticker import Tick
from .game import Game
from .menu_phase import NotesPhase
from .phase import NextPhase, before_next_episode

_DIALOG_X = 310.0
_UNATTENDED_S = 1.5  # a session without people then keeps the episode
_IGNORED_TICKS = 12  # a button pressed this early was still meant for the episode
_PRACTICE = [("continue", "keep"), ("once more", "redo"), ("quit for now", "quit")]


class ResultPhase(NotesPhase):
    """Waits for the verdict: keep, redo, or discard with a reason; notes and an undo of the last keep come before."""

    shortcuts: ClassVar = {
        Command.KEEP: "keep", Command.REDO: "redo", Command.DISCARD: "discard", Command.NOTE: "note",
        Command.UNDO: "undo",
    }  # fmt: skip

    def __init__(self, game: Game):
        assert game.trial is not None, "the phase needs an episode"
        items = [("keep", "keep"), ("redo now", "redo"), ("discard, repeat later", "discard")]
        items += [("add a note", "note"), ("keep, and quit for now", "quit")]
        if game.folder.kept_recordings and not game.schedule.in_order:
            items.insert(4, ("undo the previous keep", "undo"))
        title = outcome_text(game.trial.outcome.reason)
        super().__init__(game, title[:1].upper() + title[1:], _PRACTICE if game.trial.practice else items)

    def handle(self, press: Press) -> None:
        """Moves in the menu, or chooses by a shortcut."""
        if self.ticks >= _IGNORED_TICKS:
            super().handle(press)

    def tick(self, tick: Tick) -> NextPhase:
        """Follows the players' choice; without people or a window, the episode is kept."""
        self.ticks += 1
        if self.unattended(_UNATTENDED_S) or self.game.settings.headless:
            self._choice = "keep"
        return self.tick_notes()

    def follow(self, choice: str) -> NextPhase:
        """Carries out the verdict."""
        game = self.game
        action, _, detail = choice.partition(":")
        match action:
            case "keep" | "redo":
                game.close_trial(action, "redo" if action == "redo" else "")
            case "discard" if detail:
                game.close_trial("discard", detail)
            case "undo":
                game.undo()
                return NextPhase.STAY
            case "quit":
                game.stop = "quit"
                return NextPhase.END
            case _:
                return super().follow(choice)
        return before_next_episode(game)

    def draw(self, canvas: Canvas, fraction: float) -> None:
        """Draws the result over the world."""
        trial = self.trial
        self.draw_world(canvas, trial)
        if self.entry:
            draw_entry(canvas, self.entry.title, self.entry.text)
            return
        menu = self.menu
        lines = [Line(f"{trial.seconds:.1f} s,  score {trial.score:+.0f}", 34)]
        if trial.loop.slow:
            lines.append(Line(f"flagged: this computer was too slow ({trial.loop.skipped} ticks skipped)", 24, YELLOW))
        if trial.notes:
            lines.append(Line(f"notes: {'; '.join(trial.notes)}", 24, MUTED))
        hint = ""
        if menu is self.top and not trial.practice:
            hint = self.game.roster.hint(("a", "K", "keep"), ("x", "R", "redo"), ("y", "X", "discard"))
        colour = outcome_colour(trial.task.spec, trial.outcome.reason)
        # On the side away from the body, so that the end of the episode stays visible.
        middle = _DIALOG_X if trial.pose[0] > trial.task.required_outline.size[0] / 2 else SIZE[0] - _DIALOG_X
        draw_dialog(canvas, menu.title, lines, menu.labels, menu.cursor, colour, 560, hint, middle)
