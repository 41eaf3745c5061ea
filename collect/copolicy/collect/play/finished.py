"""The ends of a session: complete, or stopped by a disk that refuses."""

from collections import Counter
from typing import ClassVar

from ..inputs import Command
from ..screen import SIZE, Canvas
from ..screen.dialogs import Line, draw_dialog
from ..screen.palette import GREEN, MUTED, VERMILION
from ..ticker import Tick
from .game import Game
from .menu_phase import MenuPhase
from .phase import To

_ALONE_S = 2.0


class Finished(MenuPhase):
    """Thanks the pair; the last keep can still be undone."""

    shortcuts: ClassVar = {Command.UNDO: "undo"}

    def __init__(self, game: Game):
        super().__init__(game, "The session is complete", [("close", "close"), ("undo the last keep", "undo")])

    def enter(self) -> None:
        """Notes it."""
        self.game.folder.journal("finished")
        self.game.sounds.play("goal")

    def tick(self, tick: Tick) -> To:
        """Follows the choice."""
        game, choice = self.game, self.take()
        self.ticks += 1
        if choice == "close" or self.alone(_ALONE_S) or game.settings.headless:
            return To.END
        if choice == "undo":
            game.undo()
            if not game.finished:
                return To.READY
        return To.STAY

    def draw(self, canvas: Canvas, share: float) -> None:
        """Draws the summary."""
        canvas.box(0, 0, *SIZE)
        outcomes = Counter(outcome for outcome, verdict in self.game.results if verdict == "keep")
        successes = self.game.task.spec.successes
        count, noun = sum(outcomes[reason] for reason in successes), "goals" if "goal" in successes else "successes"
        kept = self.game.folder.counts.kept_here.total()
        lines = [
            Line(f"episodes kept: {kept}", 38),
            Line(f"{noun} today: {count} of {outcomes.total()}", 30, MUTED),
            Line("Thank you both.", 34),
        ]
        draw_dialog(canvas, self.menu.title, lines, self.menu.labels, self.menu.cursor, GREEN)


class Failure(MenuPhase):
    """A recording could not be written: earlier ones are complete, this one stays as `.part`."""

    def __init__(self, game: Game):
        super().__init__(game, "The recording cannot be written", [("try again", "again"), ("quit", "quit")])
        self._problem = game.problem

    def enter(self) -> None:
        """Tells; without a window nobody can be asked.

        Raises:
            RunError: there is no window.
        """
        self.game.sounds.play("alarm")
        if self.game.settings.headless:
            raise self.game.no_room()

    def tick(self, tick: Tick) -> To:
        """Follows the choice."""
        choice = self.take()
        if choice == "quit":
            self.game.stop = self._problem
            return To.END
        return To.READY if choice == "again" else To.STAY

    def draw(self, canvas: Canvas, share: float) -> None:
        """Draws the message."""
        canvas.box(0, 0, *SIZE)
        lines = [
            Line(self._problem, 36, VERMILION),
            Line("Finished episodes are complete. What there is of this one", 26, MUTED),
            Line("stays in the session's folder and can be recovered.", 26, MUTED),
        ]
        draw_dialog(canvas, self.menu.title, lines, self.menu.labels, self.menu.cursor, VERMILION, 860)
