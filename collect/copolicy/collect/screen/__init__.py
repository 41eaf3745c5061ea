"""What the players see: the world, the bars around it, dialogues, and the lobby."""

from .canvas import SIZE, WORLD, Canvas
from .text import draw_text, text_size

__all__ = ["SIZE", "WORLD", "Canvas", "draw_text", "text_size"]
