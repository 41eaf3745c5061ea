"""The break between two blocks of a session."""

import math

from ..screen import SIZE, Canvas
from ..screen.dialogs import Line, draw_dialog
from ..screen.palette import GREEN, MUTED, SKY
from ..ticker import Tick
from .game import Game
from .menu_phase import MenuPhase
from .phase import NextPhase

_UNATTENDED_S = 1.0  # a session without people then goes on


class Break(MenuPhase):
    """Waits at least as long as the break lasts, and then until somebody continues."""

    def __init__(self, game: Game):
        due = game.interludes.break_due(game.kept)
        assert due is not None, "the phase needs a break"
        self._interlude = due
        self._end_ns = game.clock() + round(due.break_s * 1e9)
        super().__init__(game, "Time for a break", [("continue", "continue"), ("quit for now", "quit")])

    @property
    def remaining_s(self) -> float:
        """Rest of the shortest break, s."""
        return max(0.0, (self._end_ns - self.game.clock()) / 1e9)

    def enter(self) -> None:
        """Writes an entry to the journal."""
        self.game.folder.journal("break", block=self._interlude.block)
        self.game.sounds.play("goal")

    def tick(self, tick: Tick) -> NextPhase:
        """Follows the players' choice; without people or a window, the session goes on."""
        game, choice = self.game, self.pop_choice()
        self.ticks += 1
        if self.unattended(_UNATTENDED_S) or game.settings.headless:
            return self._end()
        if choice == "quit":
            game.stop = "quit"
            return NextPhase.END
        if choice == "continue":
            if self.remaining_s <= 0:
                return self._end()
            game.show_message("please rest a little longer")
        return NextPhase.STAY

    def _end(self) -> NextPhase:
        self.game.interludes.rested()
        self.game.folder.journal("break over", block=self._interlude.block)
        return NextPhase.READY

    def draw(self, canvas: Canvas, fraction: float) -> None:
        """Draws what is done, and the rest of the break."""
        canvas.box(0, 0, *SIZE)
        block, blocks = self._interlude.block, self.game.interludes.blocks
        remaining = math.ceil(self.remaining_s)
        lines = [
            Line(f"Part {block} of {blocks} is done. In the next part you carry with another partner.", 30),
            Line("Put the gamepad down, look away from the screen, stretch.", 28, MUTED),
            Line(f"at least {remaining} s more" if remaining else "Go on when you are ready.", 36, SKY),
        ]
        colour = MUTED if remaining else GREEN
        draw_dialog(canvas, self.menu.title, lines, self.menu.labels, self.menu.cursor, colour, 900)
