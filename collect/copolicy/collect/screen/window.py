"""The window of the program."""

from copolicy.dataset.exceptions import RunError

from ..sdl import NoDisplayError, open_display, pygame
from .canvas import SIZE

_DESKTOP_PROPORTION = 0.86  # of the desktop, for the default size


class Window:
    """A resizable window."""

    def __init__(
        self,
        size: tuple[int, int] | None,
        fullscreen: bool,
        title: str = "two players",
        units: tuple[int, int] = SIZE,
        alternative: str = "--headless",
    ):
        """
        Args:
            size: px; by default the largest with the shape of `units` that fits the desktop well.
            fullscreen: open in full screen.
            title: of the window.
            units: width and height of the content, for its shape.
            alternative: flags that need no display, for the error.

        Raises:
            RunError: there is no display.
        """
        self._title = title
        try:
            open_display()
            desktop = pygame.display.get_desktop_sizes()[0]
            scale = max(0.4, _DESKTOP_PROPORTION * min(desktop[0] / units[0], desktop[1] / units[1]))
            self._size = size or (round(units[0] * scale), round(units[1] * scale))
            pygame.display.set_caption(f"loading: {title}")
            self._open(fullscreen)
        except (pygame.error, NoDisplayError) as error:
            raise RunError(f"expected a display (or {alternative}), found none: {error}") from None

    @property
    def surface(self) -> pygame.Surface:
        """The surface to draw on; replaced when the window's size changes."""
        return pygame.display.get_surface()

    def show(self) -> None:
        """Shows the frame that was drawn."""
        pygame.display.flip()

    def loaded(self) -> None:
        """Sets the final title, when loading is complete."""
        pygame.display.set_caption(f"copolicy: {self._title}")

    def toggle_fullscreen(self) -> None:
        """Switches between full screen and window."""
        if not self._fullscreen:
            self._size = self.surface.get_size()
        self._open(not self._fullscreen)

    def _open(self, fullscreen: bool) -> None:
        self._fullscreen = fullscreen
        if fullscreen:
            pygame.display.set_mode((0, 0), pygame.FULLSCREEN)
        else:
            pygame.display.set_mode(self._size, pygame.RESIZABLE)
