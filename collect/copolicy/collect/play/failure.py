"""When the disk says no: what happened, what is left, and how to go on."""

from ..inputs import Command, Press
from ..screen import SIZE, Canvas
from ..screen.dialogs import Line, draw_dialog
from ..screen.palette import MUTED, VERMILION
from ..ticker import Tick
from .game import Game
from .menu import Menu
from .phase import Phase, To


class Failure(Phase):
    """A recording could not be written: earlier ones are complete, this one stays as `.part`."""

    def __init__(self, game: Game):
        super().__init__(game)
        self._problem = game.problem
        self._menu = Menu("", [("try again", "again"), ("quit", "quit")])
        self._choice = ""

    def enter(self) -> None:
        """Tells; without a window nobody can be asked.

        Raises:
            RunError: there is no window.
        """
        self.game.sounds.play("alarm")
        if self.game.settings.headless:
            raise self.game.no_room()

    def handle(self, press: Press) -> None:
        """Moves in the menu."""
        if press.command != Command.BACK:
            self._choice = self._menu.handle(press) or self._choice

    def tick(self, tick: Tick) -> To:
        """Follows the choice."""
        game = self.game
        choice, self._choice = self._choice, ""
        if choice == "quit":
            game.stop = self._problem
            return To.END
        if choice == "again":
            return To.READY
        return To.STAY

    def draw(self, canvas: Canvas, share: float) -> None:
        """Draws the message."""
        canvas.box(0, 0, *SIZE)
        lines = [
            Line(self._problem, 36, VERMILION),
            Line("Finished episodes are complete. What there is of this one", 26, MUTED),
            Line("stays in the session's folder and can be recovered.", 26, MUTED),
        ]
        draw_dialog(
            canvas, "The recording cannot be written", lines, self._menu.labels, self._menu.cursor, VERMILION, 860
        )
