"""The main loop of a session: one step per tick, and frames drawn in the time between ticks."""

from collections import Counter, deque
from typing import Any

from ..inputs import Command, CommandReader, Press
from ..screen import Canvas
from ..screen.dialogs import draw_help, draw_toast
from ..screen.window import Window
from ..sdl import pygame
from ..ticker import Tick
from .break_phase import Break
from .finished import Failure, Finished
from .game import Game
from .lobby import Lobby
from .paused import Paused
from .phase import NextPhase, Phase
from .questions import Questions
from .ready import Countdown, Ready
from .result import ResultPhase
from .running import Running

_PHASES: dict[NextPhase, type[Phase]] = {
    NextPhase.LOBBY: Lobby,
    NextPhase.READY: Ready,
    NextPhase.COUNTDOWN: Countdown,
    NextPhase.RUNNING: Running,
    NextPhase.PAUSED: Paused,
    NextPhase.RESULT: ResultPhase,
    NextPhase.QUESTIONS: Questions,
    NextPhase.BREAK: Break,
    NextPhase.FAILURE: Failure,
    NextPhase.FINISHED: Finished,
}
_MARGIN_NS = 2 * 10**6  # between the end of a frame and the next tick
_MAX_FRAME_NS = 10**8  # if no frame fits between ticks, one is drawn at this interval; late ticks are flagged


class Application:
    """Runs the phases of a session.

    Every tick pumps SDL's events once and then lets the phase read the sticks, so a reading is never older than its
    tick. A frame is drawn right after a tick and half-way to the next one, if there is time for it: on a machine that
    can draw a frame between two ticks, drawing does not delay a step.

    Attributes:
        phase: the current one.
        frames: number of frames drawn so far.
    """

    def __init__(self, game: Game, window: Window | None, first: NextPhase = NextPhase.LOBBY):
        self.game = game
        self.phase: Phase = _PHASES[first](game)
        self.frames = 0
        self._window = window
        self._commands = CommandReader(game.roster.gamepads)
        self._help = False
        self._refusal = ""
        self._drawn_ns = 0
        self._draw_times_ns: deque[int] = deque([0], maxlen=20)
        self._halfway_ns = 0

    def run(self) -> None:
        """Runs until the session ends; completes the recording of a running episode."""
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
            self._leave()
            self._end_trial()
        except BaseException as error:
            if game.trial is not None:
                game.trial.abandon(error)
            raise

    def _leave(self) -> None:
        try:
            self.phase.leave()
        except OSError as error:
            self.game.problem = error.strerror or str(error)
            raise self.game.storage_error() from None

    def _end_trial(self) -> None:
        game = self.game
        try:
            game.end_trial(game.stop or "quit")
        except OSError as error:
            game.abandon_trial(error)
            raise game.storage_error() from None

    def summary(self) -> dict[str, Any]:
        """Returns what the command prints, JSON-able."""
        game = self.game
        verdicts = Counter(verdict for _, verdict in game.results)
        return {
            "session": game.folder.session_id,
            "kept": verdicts["keep"],
            "discarded": verdicts["discard"] + verdicts["redo"],
            "unwritten": verdicts["lost"],
            "outcomes": dict(sorted(Counter(outcome for outcome, _ in game.results).items())),
            "kept_in_session": game.folder.counts.kept_in_session.total(),
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
        if following is NextPhase.END:
            return False
        if following is not NextPhase.STAY:
            self.phase = _PHASES[following](self.game)
            self.phase.enter()
        return True

    def _follow_devices(self) -> None:
        """Lets waiting devices join, and between episodes checks for faulty ones."""
        game, roster = self.game, self.game.roster
        for player in roster.tick():
            self.phase.joined(player)
        if not self.phase.realtime:
            player = roster.check_devices()
            if player:
                self.phase.device_lost(player)
        if roster.refusal not in ("", self._refusal):
            game.sounds.play("alarm")
            game.show_message(roster.refusal)
        self._refusal = roster.refusal

    def _handle(self, event: pygame.event.Event) -> None:
        game, phase = self.game, self.phase
        if event.type == pygame.QUIT:
            game.stop = game.stop or "window closed"
            return
        if event.type == pygame.WINDOWFOCUSLOST and self._window:
            phase.focus_lost()
            return
        added, removed = game.roster.gamepads.handle(event)
        if added and game.settings.headless:
            game.roster.assign(added)
        if removed:
            player = game.roster.release(removed)
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
                game.show_message("sound off" if game.sounds.mute else "sound on")
            return
        press = self._commands.read(event)
        if press:
            game.roster.log_press(press)
        if phase.consume(event):
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
            return  # a press that joins gives no other command
        if not isinstance(phase, Lobby) and game.roster.is_unassigned(press):
            return
        phase.handle(press)

    def _frame_fits(self, remaining_ns: int) -> bool:
        return not self.phase.realtime or max(self._draw_times_ns) + _MARGIN_NS < remaining_ns

    def _draw(self) -> None:
        window, game = self._window, self.game
        if window is None:
            return
        now, dt_ns = game.clock(), game.ticker.dt_ns
        self._halfway_ns = now + dt_ns // 2
        overdue = now - self._drawn_ns > _MAX_FRAME_NS
        if not self._frame_fits(game.ticker.remaining_ns()) and not overdue:
            return
        canvas = Canvas(window.surface)
        canvas.clear()
        trial = game.trial
        fraction = (now - trial.step_ns) / dt_ns if trial and self.phase.realtime else 1.0
        self.phase.draw(canvas, min(1.0, max(0.0, fraction)))
        if game.toast:
            draw_toast(canvas, game.toast)
        if self._help:
            draw_help(canvas, game.roster.labels(), game.task.words.noun)
        window.show()
        self.frames += 1
        self._drawn_ns = game.clock()
        self._draw_times_ns.append(self._drawn_ns - now)
        if not self.phase.realtime:
            self._halfway_ns = self._drawn_ns + 10 * dt_ns  # nothing moves between ticks

    def _sleep(self, remaining_ns: int) -> None:
        wait = remaining_ns
        if self._window and self.phase.realtime:
            wait = min(wait, max(10**6, self._halfway_ns - self.game.clock()))
        self.game.clock.sleep(wait / 1e9)
