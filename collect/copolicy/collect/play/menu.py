"""Menus and text fields, used with gamepads or the keyboard."""

from collections.abc import Sequence

from ..inputs import Command, Press
from ..sdl import pygame

Item = tuple[str, str]
"""The label of a menu item, and the value that choosing it returns."""

BACK = "back"

NOTES = ("went well", "hesitated", "misunderstood each other", "was distracted", "trouble with a stick")
REASONS = ("was not ready", "trouble with a stick", "misunderstood the task", "disturbed from outside", "other reason")


class Menu:
    """A list with a cursor.

    Attributes:
        items: label and value of each item.
        cursor: index of the selected item.
        rows: per column, in a menu of several columns, where left and right change the column; else None.
    """

    def __init__(self, title: str, items: Sequence[Item], rows: int | None = None):
        self.title = title
        self.items = list(items)
        self.cursor = 0
        self.rows = rows

    @property
    def labels(self) -> list[str]:
        """The labels of the items."""
        return [label for label, _ in self.items]

    def handle(self, press: Press) -> str | None:
        """Moves the cursor; returns the value of a chosen item, or `BACK`."""
        if press.command in (Command.UP, Command.DOWN):
            step = 1 if press.command == Command.DOWN else -1
            self.cursor = (self.cursor + step) % len(self.items)
        elif press.command in (Command.LEFT, Command.RIGHT) and self.rows:
            index = self.cursor + (self.rows if press.command == Command.RIGHT else -self.rows)
            self.cursor = index if 0 <= index < len(self.items) else self.cursor
        elif press.command == Command.ACCEPT:
            return self.items[self.cursor][1]
        elif press.command == Command.BACK:
            return BACK
        return None


class TextEntry:
    """A text field of one line.

    Attributes:
        text: entered so far.
        done: confirmed with Enter.
        cancelled: closed with Esc.
    """

    def __init__(self, title: str, limit: int = 200):
        self.title = title
        self.text = ""
        self.done = self.cancelled = False
        self._limit = limit

    def handle(self, event: pygame.event.Event) -> None:
        """Handles a keyboard event."""
        if event.type == pygame.TEXTINPUT:
            self.text = (self.text + event.text)[: self._limit]
        elif event.type == pygame.KEYDOWN:
            if event.key in (pygame.K_RETURN, pygame.K_KP_ENTER):
                self.done = True
            elif event.key == pygame.K_ESCAPE:
                self.cancelled = True
            elif event.key == pygame.K_BACKSPACE:
                self.text = self.text[:-1]


def note_menu() -> Menu:
    """Returns a menu of predefined notes, and of writing one on the keyboard."""
    return Menu("Note (no names)", [*((note, f"note:{note}") for note in NOTES), ("type a note", "write")])


def reason_menu() -> Menu:
    """Returns a menu of reasons to discard an episode."""
    return Menu("Why discard this episode?", [(reason, f"discard:{reason}") for reason in REASONS])
