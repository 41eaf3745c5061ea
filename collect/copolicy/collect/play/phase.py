"""The interface of the phases of a session: lobby, count-down, episode, result and so on."""

from enum import Enum, auto

from copolicy.dataset.outline import interpolate_pose

from ..inputs import Press
from ..screen import WORLD, Canvas
from ..screen.hud import draw_hud
from ..sdl import pygame
from ..ticker import Tick
from .game import Game
from .menu import TextEntry
from .player import SeatedPlayer
from .trial import Trial


class NextPhase(Enum):
    """The phase that follows; STAY for the same one, END to leave the session."""

    STAY = auto()
    LOBBY = auto()
    READY = auto()
    COUNTDOWN = auto()
    RUNNING = auto()
    PAUSED = auto()
    RESULT = auto()
    QUESTIONS = auto()
    BREAK = auto()
    FAILURE = auto()
    FINISHED = auto()
    END = auto()


def before_next_episode(game: Game) -> NextPhase:
    """Returns the phase between two episodes: open questions, the end of the session, a break, or the next episode."""
    if game.open_questionnaire() is not None:
        return NextPhase.QUESTIONS
    if game.finished:
        return NextPhase.FINISHED
    return NextPhase.BREAK if game.interludes.break_due(game.kept) else NextPhase.READY


class Phase:
    """The interface of a phase, which the application's loop calls.

    Attributes:
        realtime: every tick is a step of the world, so drawing must not delay it.
        entry: the open text field, which receives all keys; None if there is none.
    """

    realtime = False

    def __init__(self, game: Game):
        self.game = game
        self.entry: TextEntry | None = None

    def enter(self) -> None:
        """Called once when the phase begins."""

    def leave(self) -> None:
        """Called once when the session ends in this phase."""

    def consume(self, event: pygame.event.Event) -> bool:
        """Handles a raw gamepad event; returns True if it must not be read as a command."""
        return False

    def handle(self, press: Press) -> None:
        """Handles a command of a player."""

    def tick(self, tick: Tick) -> NextPhase:
        """Advances the phase by one tick; returns the phase that follows."""
        return NextPhase.STAY

    def draw(self, canvas: Canvas, fraction: float) -> None:
        """Draws the phase; `fraction` is the elapsed part of the current step, in [0, 1]."""

    def joined(self, player: SeatedPlayer) -> None:
        """Called when a player has joined with a device that had to wait."""

    def device_lost(self, player: SeatedPlayer) -> None:
        """Called when the device of a player is gone."""

    def focus_lost(self) -> None:
        """Called when the window loses the keyboard focus."""

    @property
    def trial(self) -> Trial:
        """The current or next episode."""
        assert self.game.trial is not None, "the phase needs an episode"
        return self.game.trial

    def draw_world(self, canvas: Canvas, trial: Trial, fraction: float = 1.0, running: bool = True) -> None:
        """Draws the world and the bars around it; with `running` False the bars name the players of the seats."""
        view = self.game.view(trial.scenario)
        pose = interpolate_pose(trial.previous_pose, trial.pose, fraction)
        trail = [*trial.trail, pose]
        view.draw(canvas.surface, canvas.rect(*WORLD), pose, trial.forces, trail)
        draw_hud(canvas, self.game.hud(trial, running))
