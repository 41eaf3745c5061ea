"""The loop: the task's ticks, and between them as many pictures as there is time for."""

from collections import Counter, deque

from ..inputs import Command, CommandReader, Press
from ..screen import Canvas
from ..screen.dialogs import draw_help, draw_toast
from ..screen.window import Window
from ..sdl import pygame
from ..ticker import Tick
from .finished import Failure, Finished
from .game import Game
from .lobby import Lobby
from .paused import Paused
from .phase import Phase, To
from .ready import Countdown, Ready
from .result import Result
from .running import Running

_PHASES: dict[To, type[Phase]] = {
    To.LOBBY: Lobby,
    To.READY: Ready,
    To.COUNTDOWN: Countdown,
    To.RUNNING: Running,
    To.PAUSED: Paused,
    To.RESULT: Result,
    To.FAILURE: Failure,
    To.FINISHED: Finished,
}
_MARGIN_NS = 2 * 10**6  # between the end of a picture and the next tick
_STARVED_NS = 10**8  # a machine too slow to draw between ticks draws ten pictures a second, and is flagged


class Application:
    """Runs the phases of a session.

    Every tick pumps SDL's events once and then lets the phase read the sticks, so a reading is never older than its
    tick. A picture is drawn right after a tick and half-way to the next one, if it fits: drawing never makes a step
    wait where the machine can draw in time at all.

    Attributes:
        phase: the present one.
        pictures: drawn so far.
    """

    def __init__(self, game: Game, window: Window | None, first: To = To.LOBBY):
        self.game = game
        self.phase: Phase = _PHASES[first](game)
        self.pictures = 0
        self._window = window
        self._commands = CommandReader(game.roster.pads)
        self._help = False
        self._refused = ""
        self._drawn_ns = 0
        self._drawing: deque[int] = deque([0], maxlen=20)
        self._halfway_ns = 0

    def run(self) -> None:
        """Runs until the session ends, and ends a running episode in order."""
        game, ticker = self.game, self.game.ticker
        self.phase.enter()
        ticker.restart()
        try:
            while not game.stop:
                remaining = ticker.remaining_ns()
                if remaining <= 0:
                    if not self._tick(ticker.tick()):
                        break
                    self._draw()
                elif self._window and game.clock() >= self._halfway_ns:
                    self._draw()
                else:
                    self._sleep(remaining)
            self._break_off()
        except BaseException as error:
            if game.trial is not None:
                game.trial.abandon(error)
            raise

    def _break_off(self) -> None:
        game = self.game
        try:
            game.break_off(game.stop or "quit")
        except OSError as error:
            game.lose_trial(error)
            raise game.no_room() from None

    def summary(self) -> dict:
        """What the command prints."""
        game = self.game
        verdicts = Counter(verdict for _, verdict in game.results)
        return {
            "session": game.folder.session_id,
            "kept": verdicts["keep"],
            "discarded": verdicts["discard"] + verdicts["redo"],
            "unwritten": verdicts["lost"],
            "outcomes": dict(sorted(Counter(outcome for outcome, _ in game.results).items())),
            "kept_in_session": game.folder.counts.kept_here.total(),
            "episodes": game.settings.episodes,
            "complete": game.finished,
            "ended_by": game.stop or "end",
        }

    def _tick(self, tick: Tick) -> bool:
        for event in pygame.event.get():
            self._handle(event)
        if self.game.stop:
            return False
        self._follow_devices()
        following = self.phase.tick(tick)
        if following is To.END:
            return False
        if following is not To.STAY:
            self.phase = _PHASES[following](self.game)
            self.phase.enter()
        return True

    def _follow_devices(self) -> None:
        """Lets devices join that had to wait, and looks for faulty ones between the episodes."""
        game, roster = self.game, self.game.roster
        for player in roster.tick():
            self.phase.joined(player)
        if not self.phase.realtime:
            player = roster.watch()
            if player:
                self.phase.device_lost(player)
        if roster.refused not in ("", self._refused):
            game.sounds.play("alarm")
            game.say(roster.refused)
        self._refused = roster.refused

    def _handle(self, event: pygame.event.Event) -> None:
        game, phase = self.game, self.phase
        if event.type == pygame.QUIT:
            game.stop = game.stop or "window closed"
            return
        if event.type == pygame.WINDOWFOCUSLOST and self._window:
            phase.focus_lost()
            return
        added, removed = game.roster.pads.handle(event)
        if added and game.settings.headless:
            game.roster.give(added)
        if removed:
            player = game.roster.take_away(removed)
            if player:
                phase.device_lost(player)
        if phase.entry is not None:
            phase.entry.handle(event)
            if event.type in (pygame.KEYDOWN, pygame.TEXTINPUT):
                return
        if self._window and event.type == pygame.KEYDOWN and event.key in (pygame.K_F11, pygame.K_m):
            if event.key == pygame.K_F11:
                self._window.toggle_fullscreen()
            else:
                game.sounds.mute = not game.sounds.mute
                game.say("sound off" if game.sounds.mute else "sound on")
            return
        press = self._commands.read(event)
        if press:
            game.roster.note(press)
        if phase.takes(event):
            return
        if press:
            self._press(press)

    def _press(self, press: Press) -> None:
        game, phase = self.game, self.phase
        if self._help and not press.moved:
            self._help = False
            return
        if press.command == Command.HELP:
            self._help = True
        if not isinstance(phase, Lobby) and not isinstance(phase, Running) and game.roster.join(press):
            return  # a press that gives a lost seat a device chooses nothing
        if not isinstance(phase, Lobby) and game.roster.is_stray(press):
            return
        phase.handle(press)

    def _fits(self, remaining_ns: int) -> bool:
        return not self.phase.realtime or max(self._drawing) + _MARGIN_NS < remaining_ns

    def _draw(self) -> None:
        window, game = self._window, self.game
        if window is None:
            return
        now, dt_ns = game.clock(), game.ticker.dt_ns
        self._halfway_ns = now + dt_ns // 2
        starved = now - self._drawn_ns > _STARVED_NS
        if not self._fits(game.ticker.remaining_ns()) and not starved:
            return
        canvas = Canvas(window.surface)
        canvas.clear()
        trial = game.trial
        share = (now - trial.step_ns) / dt_ns if trial and self.phase.realtime else 1.0
        self.phase.draw(canvas, min(1.0, max(0.0, share)))
        if game.toast:
            draw_toast(canvas, game.toast)
        if self._help:
            draw_help(canvas, game.roster.labels(), game.task.spec.name)
        window.show()
        self.pictures += 1
        self._drawn_ns = game.clock()
        self._drawing.append(self._drawn_ns - now)
        if not self.phase.realtime:
            self._halfway_ns = self._drawn_ns + 10 * dt_ns  # nothing moves between the ticks

    def _sleep(self, remaining_ns: int) -> None:
        wait = remaining_ns
        if self._window and self.phase.realtime:
            wait = min(wait, max(10**6, self._halfway_ns - self.game.clock()))
        self.game.clock.sleep(wait / 1e9)
