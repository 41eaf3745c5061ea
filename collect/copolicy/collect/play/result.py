"""The end of an episode: how it went, and what is to become of its recording."""

from typing import ClassVar

from ..inputs import Command, Press
from ..screen import SIZE, Canvas
from ..screen.dialogs import Line, draw_dialog, draw_entry, outcome_colour, outcome_text
from ..screen.palette import MUTED, YELLOW
from ..ticker import Tick
from .game import Game
from .menu_phase import NotesPhase
from .phase import To

_LEFT = 310.0
_ALONE_S = 1.5  # without people the result stands for so long
_DEAF_TICKS = 12  # a button that was meant for the episode is no verdict
_PRACTICE = [("go on", "keep"), ("once more", "redo"), ("quit for now", "quit")]


class Result(NotesPhase):
    """Waits for the verdict: keep, redo, discard with a reason; notes before it, the last keep undone."""

    shortcuts: ClassVar = {
        Command.KEEP: "keep", Command.REDO: "redo", Command.DISCARD: "discard", Command.NOTE: "note",
        Command.UNDO: "undo",
    }  # fmt: skip

    def __init__(self, game: Game):
        assert game.trial is not None, "a result of an episode without one"
        items = [("keep", "keep"), ("redo now", "redo"), ("discard: comes again later", "discard")]
        items += [("add a note", "note"), ("keep, and quit for now", "quit")]
        if game.folder.kept:
            items.insert(4, ("undo the keep before", "undo"))
        title = outcome_text(game.trial.outcome.reason)
        super().__init__(game, title[:1].upper() + title[1:], _PRACTICE if game.trial.practice else items)

    def handle(self, press: Press) -> None:
        """Moves in the menu, or takes a short cut."""
        if self.ticks >= _DEAF_TICKS:
            super().handle(press)

    def tick(self, tick: Tick) -> To:
        """Follows the players' choice; without people, or without a window, every episode is kept."""
        self.ticks += 1
        if self.alone(_ALONE_S) or self.game.settings.headless:
            self._choice = "keep"
        return self.tick_notes()

    def follow(self, choice: str) -> To:
        """The verdict."""
        game = self.game
        kind, _, detail = choice.partition(":")
        match kind:
            case "keep" | "redo":
                game.close_trial(kind, "redo" if kind == "redo" else "")
            case "discard" if detail:
                game.close_trial("discard", detail)
            case "undo":
                game.undo()
                return To.STAY
            case "quit":
                game.stop = "quit"
                return To.END
            case _:
                return super().follow(choice)
        return To.FINISHED if game.finished else To.READY

    def draw(self, canvas: Canvas, share: float) -> None:
        """Draws the result over the world."""
        trial = self.trial
        self.draw_world(canvas, trial)
        if self.entry:
            draw_entry(canvas, self.entry.title, self.entry.text)
            return
        menu = self.menu
        lines = [Line(f"{trial.seconds:.1f} s,  score {trial.score:+.0f}", 34)]
        if trial.loop.slow:
            lines.append(Line(f"the loop was too slow ({trial.loop.skipped} skipped ticks): flagged", 24, YELLOW))
        if trial.notes:
            lines.append(Line(f"notes: {'; '.join(trial.notes)}", 24, MUTED))
        hint = ""
        if menu is self.top and not trial.practice:
            hint = self.game.roster.hint(("a", "K", "keep"), ("x", "R", "redo"), ("y", "X", "discard"))
        colour = outcome_colour(trial.task.spec, trial.outcome.reason)
        # Beside the body, so that everybody sees what happened.
        middle = _LEFT if trial.pose[0] > trial.task.required_outline.size[0] / 2 else SIZE[0] - _LEFT
        draw_dialog(canvas, menu.title, lines, menu.labels, menu.cursor, colour, 560, hint, middle)
