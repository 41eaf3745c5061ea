"""One state of a session: the lobby, an episode about to begin, the episode itself, its result, the end."""

from enum import Enum, auto

from copolicy.dataset.outline import interpolate_pose

from ..inputs import Press
from ..screen import WORLD, Canvas
from ..screen.hud import draw_hud
from ..sdl import pygame
from ..ticker import Tick
from .game import Game
from .menu import TextEntry
from .player import Player
from .trial import Trial


class To(Enum):
    """Where a phase leads."""

    STAY = auto()
    LOBBY = auto()
    READY = auto()
    COUNTDOWN = auto()
    RUNNING = auto()
    PAUSED = auto()
    RESULT = auto()
    FAILURE = auto()
    FINISHED = auto()
    END = auto()


class Phase:
    """What the loop asks of every phase; a phase overrides what concerns it.

    Attributes:
        entry: a line that is being written; it gets all keys while there is one.
        realtime: a step hangs on every tick, so drawing must not be in its way.
    """

    realtime = False

    def __init__(self, game: Game):
        self.game = game
        self.entry: TextEntry | None = None

    def enter(self) -> None:
        """It begins."""

    def takes(self, event: pygame.event.Event) -> bool:
        """The phase wants an event of a joystick for itself; it commands nothing then."""
        return False

    def handle(self, press: Press) -> None:
        """A player asks for something."""

    def tick(self, tick: Tick) -> To:
        """A step of the task; says what follows."""
        return To.STAY

    def draw(self, canvas: Canvas, share: float) -> None:
        """Draws itself; `share` in [0, 1] of the time between two steps is over."""

    def joined(self, player: Player) -> None:
        """A player has a device now that had to wait."""

    def device_lost(self, player: Player) -> None:
        """The device of a player is gone."""

    def focus_lost(self) -> None:
        """The window is no longer the one that gets the keys."""

    @property
    def trial(self) -> Trial:
        """The episode that is played or about to be."""
        assert self.game.trial is not None, "a phase of an episode without one"
        return self.game.trial

    def draw_world(self, canvas: Canvas, trial: Trial, share: float = 1.0, carrying: bool = True) -> None:
        """Draws the world and the bars around it; before the episode the bars say who sits where."""
        view = self.game.view(trial.map_config)
        pose = interpolate_pose(trial.before, trial.pose, share)
        trail = [*trial.trail, pose]
        view.draw(canvas.surface, canvas.rect(*WORLD), pose, trial.forces, trail)
        draw_hud(canvas, self.game.hud(trial, carrying))
