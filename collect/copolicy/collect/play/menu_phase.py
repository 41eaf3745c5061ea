"""Phases that the players leave by a menu: how choices are taken, and what may be written about an episode."""

from collections.abc import Mapping, Sequence
from typing import ClassVar

from ..inputs import Command, Press
from .game import Game
from .menu import BACK, Item, Menu, TextEntry, note_menu, reason_menu
from .phase import Phase, To


class MenuPhase(Phase):
    """A phase with a menu, above which others open; `back` closes these.

    Attributes:
        shortcuts: choices by the command that makes them at once, where the menu has them.
        top: the menu below all others.
        ticks: since the phase began.
    """

    shortcuts: ClassVar[Mapping[Command, str]] = {}

    def __init__(self, game: Game, title: str, items: Sequence[Item], rows: int | None = None):
        super().__init__(game)
        self.top = Menu(title, items, rows)
        self.ticks = 0
        self._menus = [self.top]
        self._choice = ""

    @property
    def menu(self) -> Menu:
        """The one in front."""
        return self._menus[-1]

    def handle(self, press: Press) -> None:
        """Moves in the menu, or takes a short cut."""
        choice = self.shortcuts.get(press.command)
        if choice is None or choice not in [value for _, value in self.menu.items]:
            choice = self.menu.handle(press)
        self._choice = choice or self._choice

    def take(self) -> str:
        """The choice of this tick; empty where there is none."""
        choice, self._choice = self._choice, ""
        return choice

    def alone(self, seconds: float) -> bool:
        """Nobody is there to choose, and the phase has lasted for so long."""
        people = any(player.person for player in self.game.players)
        return not people and self.ticks * self.game.ticker.dt_ns > seconds * 1e9


class NotesPhase(MenuPhase):
    """A phase of an episode that has begun, with notes about it and reasons to discard it."""

    def tick_notes(self) -> To:
        """Takes what was written, then follows the choice; a disk that refuses ends the episode."""
        if self.entry and (self.entry.done or self.entry.left):
            if self.entry.done and self.entry.text.strip():
                self._note(self.entry.text.strip())
            self.entry = None
        choice = self.take()
        try:
            return self.follow(choice) if choice else To.STAY
        except OSError as error:
            self.game.lose_trial(error)
            return To.FAILURE

    def follow(self, choice: str) -> To:
        """What a choice leads to; a phase adds its own."""
        kind, _, detail = choice.partition(":")
        match kind:
            case "note" if not detail:
                self._menus.append(note_menu())
            case "note":
                self._note(detail)
            case "write":
                self.entry = TextEntry("Note (no names)")
                self._menus = [self.top]
            case "discard":
                self._menus.append(reason_menu())
            case _ if choice == BACK and len(self._menus) > 1:
                self._menus.pop()
        return To.STAY

    def _note(self, text: str) -> None:
        self.trial.note(text)
        self._menus = [self.top]
        self.game.say("note added")
