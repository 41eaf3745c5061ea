"""The phases at the end of a session: it is complete, or a recording cannot be written."""

from collections import Counter
from typing import ClassVar

from ..inputs import Command
from ..screen import SIZE, Canvas
from ..screen.dialogs import Line, draw_dialog
from ..screen.palette import GREEN, MUTED, VERMILION
from ..ticker import Tick
from .game import Game
from .menu_phase import MenuPhase
from .phase import NextPhase, before_next_episode

_UNATTENDED_S = 2.0  # a session without people then closes


class Finished(MenuPhase):
    """Shows a summary; the last keep can still be undone."""

    shortcuts: ClassVar = {Command.UNDO: "undo"}

    def __init__(self, game: Game):
        super().__init__(game, "The session is complete", [("close", "close"), ("undo the last keep", "undo")])

    def enter(self) -> None:
        """Writes an entry to the journal."""
        self.game.folder.journal("finished")
        self.game.sounds.play("goal")

    def tick(self, tick: Tick) -> NextPhase:
        """Follows the players' choice; without people or a window, the session closes."""
        game, choice = self.game, self.pop_choice()
        self.ticks += 1
        if choice == "close" or self.unattended(_UNATTENDED_S) or game.settings.headless:
            return NextPhase.END
        if choice == "undo":
            game.undo()
            if not game.finished:
                return NextPhase.READY
        return NextPhase.STAY

    def draw(self, canvas: Canvas, fraction: float) -> None:
        """Draws the summary."""
        canvas.box(0, 0, *SIZE)
        outcomes = Counter(outcome for outcome, verdict in self.game.results if verdict == "keep")
        successes = self.game.task.spec.successes
        count, noun = sum(outcomes[reason] for reason in successes), "goals" if "goal" in successes else "successes"
        people = [player for player in self.game.players if player.person]
        lines = [
            Line(f"episodes kept: {self.game.folder.counts.kept_in_session.total()}", 38),
            Line(f"{noun} today: {count} of {outcomes.total()}", 30, MUTED),
            Line("Thank you both." if len(people) == 2 else "Thank you.", 34),
        ]
        draw_dialog(canvas, self.menu.title, lines, self.menu.labels, self.menu.cursor, GREEN)


class Failure(MenuPhase):
    """A recording or an answer could not be written: a recording stays as `.part`, and earlier ones are complete."""

    def __init__(self, game: Game):
        super().__init__(game, "A file cannot be written", [("try again", "again"), ("quit", "quit")])
        self._problem = game.problem

    def enter(self) -> None:
        """Plays a tone.

        Raises:
            RunError: there is no window, so that nobody can choose.
        """
        self.game.sounds.play("alarm")
        if self.game.settings.headless:
            raise self.game.storage_error()

    def tick(self, tick: Tick) -> NextPhase:
        """Follows the players' choice."""
        choice = self.pop_choice()
        if choice == "quit":
            self.game.stop = self._problem
            return NextPhase.END
        return before_next_episode(self.game) if choice == "again" else NextPhase.STAY

    def draw(self, canvas: Canvas, fraction: float) -> None:
        """Draws the message."""
        canvas.box(0, 0, *SIZE)
        lines = [
            Line(self._problem, 36, VERMILION),
            Line("Finished episodes and saved answers are safe. The part of an", 26, MUTED),
            Line("episode stays in the session's folder and can be recovered.", 26, MUTED),
        ]
        draw_dialog(canvas, self.menu.title, lines, self.menu.labels, self.menu.cursor, VERMILION, 860)
