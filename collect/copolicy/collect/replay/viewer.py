"""The interactive window of a replay."""

import time
from collections.abc import Callable
from pathlib import Path

from ..screen.window import Window
from ..sdl import pygame
from .frames import write_png
from .playback import Playback
from .track import Track
from .view import SIZE, ReplayView, ViewOptions

_FRAMES_HZ = 60
_MESSAGE_S = 2.5


class Viewer:
    """Shows a track in a window until the user quits.

    Attributes:
        playback: position and speed.
        options: what is drawn.
        open: the user has not quit.
    """

    def __init__(self, track: Track, clock: Callable[[], float] = time.perf_counter):
        """Opens the window.

        Raises:
            RunError: there is no display.
        """
        self.playback = Playback(track.steps, hz=track.hz)
        self.options = ViewOptions()
        self.open = True
        self._track = track
        self._view = ReplayView(track)
        self._clock = clock
        self._dragging = False
        self._was_playing = False
        self._message_until = 0.0
        self._window = Window(None, False, track.path.name, SIZE, "--out FILE")
        self._window.loaded()
        pygame.key.set_repeat(350, 40)

    def run(self) -> None:
        """Runs until the window is closed."""
        before = self._clock()
        frame_clock = pygame.time.Clock()
        while self.open:
            for event in pygame.event.get():
                self.handle(event)
            now = self._clock()
            self.advance(now - before)
            before = now
            self.draw()
            frame_clock.tick(_FRAMES_HZ)
        pygame.display.quit()

    def advance(self, seconds: float) -> None:
        """Advances the playback by real time, and clears an expired message."""
        if not self._dragging:
            self.playback.advance(seconds)
        if self.options.message and self._clock() > self._message_until:
            self.options.message = ""

    def draw(self) -> None:
        """Draws and shows a frame."""
        self._view.draw(self._window.surface, self.playback, self.options)
        self._window.show()

    def handle(self, event: pygame.event.Event) -> None:
        """Handles an event of the keyboard, the mouse or the window."""
        if event.type == pygame.QUIT:
            self.open = False
        elif event.type == pygame.KEYDOWN:
            self._key(event.key, bool(event.mod & pygame.KMOD_SHIFT))
        elif event.type == pygame.MOUSEWHEEL:
            self.playback.step(self.playback.hz * event.y)
        elif event.type == pygame.MOUSEBUTTONDOWN and event.button == 1:
            self._press(event.pos)
        elif event.type == pygame.MOUSEMOTION and self._dragging:
            self._drag(event.pos)
        elif event.type == pygame.MOUSEBUTTONUP and event.button == 1 and self._dragging:
            self._dragging = False
            self.playback.playing = self._was_playing and self.playback.position < self.playback.steps

    def _key(self, key: int, shift: bool) -> None:
        playback, options = self.playback, self.options
        stride = playback.hz if shift else 1
        if key in (pygame.K_q, pygame.K_ESCAPE):
            if options.help and key == pygame.K_ESCAPE:
                options.help = False
            else:
                self.open = False
        elif key == pygame.K_SPACE:
            playback.toggle()
        elif key in (pygame.K_LEFT, pygame.K_RIGHT):
            playback.step(stride if key == pygame.K_RIGHT else -stride)
        elif key in (pygame.K_UP, pygame.K_DOWN):
            playback.change_speed(1 if key == pygame.K_UP else -1)
        elif key in (pygame.K_HOME, pygame.K_END):
            playback.seek(0 if key == pygame.K_HOME else playback.steps)
        elif key == pygame.K_t:
            options.trails = not options.trails
        elif key == pygame.K_f:
            options.forces = not options.forces
        elif key in (pygame.K_h, pygame.K_F1):
            options.help = not options.help
        elif key == pygame.K_s:
            self._save()
        elif key == pygame.K_F11:
            self._window.toggle_fullscreen()

    def _press(self, point: tuple[int, int]) -> None:
        position = self._view.position_at(self._window.surface, point)
        if position is None:
            self.playback.toggle()
            return
        self._dragging, self._was_playing = True, self.playback.playing
        self.playback.seek(position)

    def _drag(self, point: tuple[int, int]) -> None:
        position = self._view.position_at(self._window.surface, point, dragging=True)
        if position is not None:
            self.playback.seek(position)

    def _save(self) -> None:
        surface = self._window.surface.copy()
        self._view.draw(surface, self.playback, ViewOptions(self.options.trails, self.options.forces, hint=False))
        name = f"{self._track.path.stem}_step_{int(self.playback.position):04d}.png"
        path = _unused_path(self._track.path.with_name(name))
        try:
            write_png(surface, path)
            self._show_message(f"saved {path.name}")
        except OSError as error:
            self._show_message(f"not saved: {error}")

    def _show_message(self, message: str) -> None:
        self.options.message = message
        self._message_until = self._clock() + _MESSAGE_S


def _unused_path(path: Path) -> Path:
    """Returns the path, or one with a number appended if it exists."""
    number, unused = 2, path
    while unused.exists():
        unused, number = path.with_name(f"{path.stem}-{number}{path.suffix}"), number + 1
    return unused
