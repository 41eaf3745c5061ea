"""What the players see: the world, the bars around it, dialogues, and the lobby."""

from .canvas import SIZE, WORLD, Canvas
from .table_view import SEAT_POINTS, TableView, between, letterbox
from .text import draw_text, text_size

__all__ = ["SEAT_POINTS", "SIZE", "WORLD", "Canvas", "TableView", "between", "draw_text", "letterbox", "text_size"]
