"""Drawing of the screen: the world, the bars around it, dialogs and the lobby."""

from .canvas import SIZE, WORLD, Canvas
from .text import draw_text, text_size

__all__ = ["SIZE", "WORLD", "Canvas", "draw_text", "text_size"]
