"""A window that somebody looks at."""

from copolicy.dataset.exceptions import RunError

from ..sdl import NoDisplayError, open_display, pygame
from .canvas import SIZE

_OF_DESKTOP = 0.86  # of the desktop's smaller side that a window takes by itself


class Window:
    """A window of any size."""

    def __init__(
        self,
        size: tuple[int, int] | None,
        fullscreen: bool,
        title: str = "two players",
        units: tuple[int, int] = SIZE,
        instead: str = "--headless",
    ):
        """
        Args:
            size: px; by default what suits the desktop and the shape of `units`.
            fullscreen: begin so.
            title: what it is for.
            instead: flags that need no display, for the error.

        Raises:
            RunError: there is no display.
        """
        self._title = title
        try:
            open_display()
            desktop = pygame.display.get_desktop_sizes()[0]
            scale = max(0.4, _OF_DESKTOP * min(desktop[0] / units[0], desktop[1] / units[1]))
            self._size = size or (round(units[0] * scale), round(units[1] * scale))
            pygame.display.set_caption(f"loading: {title}")
            self._open(fullscreen)
        except (pygame.error, NoDisplayError) as error:
            raise RunError(f"expected a display (or {instead}), found none: {error}") from None

    @property
    def surface(self) -> pygame.Surface:
        """What to draw on; another one after the window's size has changed."""
        return pygame.display.get_surface()

    def show(self) -> None:
        """Shows what was drawn."""
        pygame.display.flip()

    def loaded(self) -> None:
        """Says in the title that everything is there."""
        pygame.display.set_caption(f"copolicy: {self._title}")

    def toggle_fullscreen(self) -> None:
        """Full screen and back."""
        if not self._fullscreen:
            self._size = self.surface.get_size()
        self._open(not self._fullscreen)

    def _open(self, fullscreen: bool) -> None:
        self._fullscreen = fullscreen
        if fullscreen:
            pygame.display.set_mode((0, 0), pygame.FULLSCREEN)
        else:
            pygame.display.set_mode(self._size, pygame.RESIZABLE)
