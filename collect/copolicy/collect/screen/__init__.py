"""What the players see: one view of the world, text, and the colours of both."""

from .table_view import SEAT_POINTS, TableView, between, letterbox
from .text import draw_text, text_size

__all__ = ["SEAT_POINTS", "TableView", "between", "draw_text", "letterbox", "text_size"]
