"""Phases with a menu, and phases with notes about an episode."""

from collections.abc import Mapping, Sequence
from typing import ClassVar

from ..inputs import Command, Press
from .game import Game
from .menu import BACK, Item, Menu, TextEntry, note_menu, reason_menu
from .phase import NextPhase, Phase


class MenuPhase(Phase):
    """A phase with a menu and submenus, which `BACK` closes.

    Attributes:
        shortcuts: value of an item, by the command that chooses it directly if the menu has it.
        top: the first menu.
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
        """The open menu or submenu."""
        return self._menus[-1]

    def handle(self, press: Press) -> None:
        """Moves in the menu, or chooses by a shortcut."""
        choice = self.shortcuts.get(press.command)
        if choice is None or choice not in [value for _, value in self.menu.items]:
            choice = self.menu.handle(press)
        self._choice = choice or self._choice

    def pop_choice(self) -> str:
        """Returns and clears the choice of this tick; empty if there is none."""
        choice, self._choice = self._choice, ""
        return choice

    def unattended(self, seconds: float) -> bool:
        """Whether no player is a person and the phase has lasted this long."""
        people = any(player.person for player in self.game.players)
        return not people and self.ticks * self.game.ticker.dt_ns > seconds * 1e9


class NotesPhase(MenuPhase):
    """A phase in which players add notes to an episode or discard it with a reason."""

    def tick_notes(self) -> NextPhase:
        """Adds an entered note, then follows the choice; leads to FAILURE if the recording cannot be written."""
        if self.entry and (self.entry.done or self.entry.cancelled):
            if self.entry.done and self.entry.text.strip():
                self._note(self.entry.text.strip())
            self.entry = None
        choice = self.pop_choice()
        try:
            return self.follow(choice) if choice else NextPhase.STAY
        except OSError as error:
            self.game.abandon_trial(error)
            return NextPhase.FAILURE

    def follow(self, choice: str) -> NextPhase:
        """Carries out a choice and returns the next phase; subclasses add their own choices."""
        action, _, detail = choice.partition(":")
        match action:
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
        return NextPhase.STAY

    def _note(self, text: str) -> None:
        self.trial.note(text)
        self._menus = [self.top]
        self.game.show_message("note added")
