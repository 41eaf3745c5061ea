"""Choosing one of several things, and writing a line, with whatever the players hold."""

from collections.abc import Sequence

from ..inputs import Command, Press
from ..sdl import pygame

Item = tuple[str, str]
"""What stands in a menu, and what choosing it means."""

BACK = "back"

NOTES = ("went well", "hesitated", "misunderstood each other", "was distracted", "trouble with a stick")
REASONS = ("was not ready", "trouble with a stick", "misunderstood the task", "disturbed from outside", "other reason")


class Menu:
    """A list with a cursor.

    Attributes:
        rows: of each column, where it is drawn in several: left and right go to the column beside it.
    """

    def __init__(self, title: str, items: Sequence[Item], rows: int | None = None):
        self.title = title
        self.items = list(items)
        self.cursor = 0
        self.rows = rows

    @property
    def labels(self) -> list[str]:
        """What stands in it."""
        return [label for label, _ in self.items]

    def handle(self, press: Press) -> str | None:
        """Moves the cursor, or returns the choice; `back` where the player wants back."""
        if press.command in (Command.UP, Command.DOWN):
            step = 1 if press.command == Command.DOWN else -1
            self.cursor = (self.cursor + step) % len(self.items)
        elif press.command in (Command.LEFT, Command.RIGHT) and self.rows:
            beside = self.cursor + (self.rows if press.command == Command.RIGHT else -self.rows)
            self.cursor = beside if 0 <= beside < len(self.items) else self.cursor
        elif press.command == Command.ACCEPT:
            return self.items[self.cursor][1]
        elif press.command == Command.BACK:
            return BACK
        return None


class TextEntry:
    """A line that is written on the keyboard.

    Attributes:
        text: so far.
        done: it is finished (with Enter).
        left: it was left (with Esc).
    """

    def __init__(self, title: str, limit: int = 200):
        self.title = title
        self.text = ""
        self.done = self.left = False
        self._limit = limit

    def handle(self, event: pygame.event.Event) -> None:
        """Takes an event of the keyboard."""
        if event.type == pygame.TEXTINPUT:
            self.text = (self.text + event.text)[: self._limit]
        elif event.type == pygame.KEYDOWN:
            if event.key in (pygame.K_RETURN, pygame.K_KP_ENTER):
                self.done = True
            elif event.key == pygame.K_ESCAPE:
                self.left = True
            elif event.key == pygame.K_BACKSPACE:
                self.text = self.text[:-1]


def note_menu() -> Menu:
    """Notes that need no keyboard, and one that does."""
    return Menu("Note (no names)", [*((note, f"note:{note}") for note in NOTES), ("write it on the keyboard", "write")])


def reason_menu() -> Menu:
    """Reasons to discard an episode."""
    return Menu("Discard: why?", [(reason, f"discard:{reason}") for reason in REASONS])
