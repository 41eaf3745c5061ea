"""The end of a session."""

from collections import Counter

from ..inputs import Command, Press
from ..screen import SIZE, Canvas
from ..screen.dialogs import Line, draw_dialog
from ..screen.palette import GREEN, MUTED
from ..ticker import Tick
from .game import Game
from .menu import Menu
from .phase import Phase, To

_ALONE_S = 2.0


class Finished(Phase):
    """Thanks the pair; the last keep can still be undone."""

    def __init__(self, game: Game):
        super().__init__(game)
        self._menu = Menu("", [("close", "close"), ("undo the last keep", "undo")])
        self._choice = ""
        self._ticks = 0

    def enter(self) -> None:
        """Notes it."""
        self.game.folder.journal("finished")
        self.game.sounds.play("goal")

    def handle(self, press: Press) -> None:
        """Closes, or undoes."""
        if press.command == Command.UNDO:
            self._choice = "undo"
        elif press.command != Command.BACK:
            self._choice = self._menu.handle(press) or self._choice

    def tick(self, tick: Tick) -> To:
        """Follows the choice."""
        game = self.game
        self._ticks += 1
        alone = not any(player.person for player in game.players) and self._ticks * game.ticker.dt_ns > _ALONE_S * 1e9
        choice, self._choice = self._choice, ""
        if choice == "close" or alone or game.settings.headless:
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
        goals = sum(outcomes[reason] for reason in self.game.task.spec.successes)
        kept = self.game.folder.counts.kept_here.total()
        lines = [
            Line(f"episodes kept: {kept}", 38),
            Line(f"goals today: {goals} of {outcomes.total()}", 30, MUTED),
            Line("Thank you both.", 34),
        ]
        draw_dialog(canvas, "The session is complete", lines, self._menu.labels, self._menu.cursor, GREEN)
