"""The lobby: players join, test and set up their devices, and confirm."""

from ..inputs import Command, Gamepad, Press
from ..screen import Canvas
from ..screen.dialogs import draw_entry
from ..screen.lobby_view import LobbyPanel, draw_lobby
from ..sdl import pygame
from ..ticker import Tick
from .game import Game
from .menu import Menu, TextEntry
from .phase import NextPhase, Phase, before_next_episode
from .player import SeatedPlayer
from .stick_setup import StickSetup

_READY_TICKS = 15  # between the last player's confirmation and the next phase


class Lobby(Phase):
    """Waits until both players are ready; each has a menu of their own."""

    def __init__(self, game: Game):
        super().__init__(game)
        self._menus: dict[int, Menu] = {}
        self._setups = {player.index: StickSetup(game, player) for player in game.players}
        self._writer: SeatedPlayer | None = None
        self._ready_ticks = 0
        self._quit = False

    def enter(self) -> None:
        """Asks people to confirm again; other players are always ready."""
        for player in self.game.players:
            player.ready = not player.spec.is_person

    def consume(self, event: pygame.event.Event) -> bool:
        """Passes events of a gamepad to the set-up of its buttons, if it is open."""
        return any(setup.consume(event) for setup in self._setups.values())

    def handle(self, press: Press) -> None:
        """Joins a player, or moves in their menu."""
        game = self.game
        if press.command == Command.SWAP:
            self._swap()
            return
        player = game.roster.player_of(press)
        if player is None:
            joined = game.roster.join(press)
            if joined:
                self.joined(joined)
            elif press.command == Command.PAUSE and isinstance(press.device, str):
                self._escape()
            return
        if press.moved or self._is_steering(player, press):
            return  # the player tests the stick
        setup = self._setups[player.index]
        if setup.busy:
            if press.command == Command.BACK:
                setup.cancel()
            return
        if player.ready:
            if press.command == Command.BACK:
                player.ready = False
            return
        menu = self._menu(player)
        if press.command == Command.BACK:  # with two buttons only, this one moves down
            menu.cursor = (menu.cursor + 1) % len(menu.items)
            return
        choice = menu.items[menu.cursor][1]
        if press.command in (Command.LEFT, Command.RIGHT):
            setup.change(choice, 1 if press.command == Command.RIGHT else -1)
        elif menu.handle(press):
            self._choose(player, choice)

    def tick(self, tick: Tick) -> NextPhase:
        """Advances calibrations; leads on when both players are ready."""
        game = self.game
        if self._quit:
            game.stop = game.stop or "quit"
            return NextPhase.END
        self._close_entry()
        for setup in self._setups.values():
            if setup.tick():
                game.sounds.play("goal")
            if setup.message:
                game.show_message(setup.message)
                setup.message = ""
        if self.entry is None and all(player.ready and not player.lacks_device for player in game.players):
            self._ready_ticks += 1
            if self._ready_ticks > _READY_TICKS:
                return before_next_episode(game)
        else:
            self._ready_ticks = 0
        return NextPhase.STAY

    def joined(self, player: SeatedPlayer) -> None:
        """Opens the player's menu."""
        self.game.sounds.play("go")
        player.ready = False
        self._menus.pop(player.index, None)
        self._setups[player.index].cancel()

    def device_lost(self, player: SeatedPlayer) -> None:
        """Closes the player's set-up; they have to join again."""
        player.ready = False
        self._setups[player.index].cancel()

    def draw(self, canvas: Canvas, fraction: float) -> None:
        """Draws the summary of the session and a panel for each player."""
        game, settings = self.game, self.game.settings
        kept, words = game.folder.counts.kept_in_session.total(), game.task.words
        summary = (
            f"{settings.episodes} episodes to keep{f', {kept} kept already' if kept else ''}; "
            f"{settings.practice} practice episodes, {len(game.scenarios)} {words.scenarios}"
            f"{' (continued session)' if game.folder.continued else ''}"
        )
        panels = [self._panel(seat, player) for seat, player in enumerate(game.seats())]
        lines = (summary, words.instruction or game.task.spec.sentence)
        draw_lobby(canvas, f"Pair {settings.pair}", lines, panels, settings.may_exchange_seats)
        if self.entry:
            draw_entry(canvas, self.entry.title, self.entry.text)

    def _panel(self, seat: int, player: SeatedPlayer) -> LobbyPanel:
        if player.lacks_device:
            joystick = player.spec.kind == "joystick"
            prompt = "press any gamepad button to join" if joystick else "press one of your keys to join"
            return LobbyPanel(seat, player.player_id, prompt, notice=self.game.roster.refusal if joystick else "")
        setup, device = self._setups[player.index], player.device
        menu = self._menu(player) if player.person else None
        panel = LobbyPanel(
            seat,
            player.player_id,
            self._prompt(player),
            device=player.label,
            items=menu.labels if menu else [],
            cursor=menu.cursor if menu else -1,
            ready=player.ready,
            progress=setup.progress if setup.busy else None,
            notice=setup.notice,
        )
        if player.person is None or device is None:
            return panel
        sample = player.person.sample()
        panel.force = player.person.force(sample)
        if isinstance(device, Gamepad):
            calibration = player.person.calibration
            x, y = (sample.positions[axis] for axis in calibration.axes)
            panel.stick, panel.dead_zone = (x, y), calibration.dead_zone
            panel.steering = device.steering(calibration).label
        else:
            panel.stick, panel.steering = (sample.axes[0], sample.axes[1]), "keys"
        return panel

    def _is_steering(self, player: SeatedPlayer, press: Press) -> bool:
        """Whether a press comes from a d-pad that steers; like a stick, it gives no commands in the lobby."""
        gamepad, directions = player.device, (Command.UP, Command.DOWN, Command.LEFT, Command.RIGHT)
        if press.command not in directions or not isinstance(gamepad, Gamepad) or player.person is None:
            return False
        return gamepad.steering(player.person.calibration).digital

    def _prompt(self, player: SeatedPlayer) -> str:
        setup = self._setups[player.index]
        if setup.busy:
            return setup.prompt
        if isinstance(player.device, Gamepad):
            labels = player.device.labels
            return f"{labels['a']}: choose   {labels['b']}: next"
        return "Enter or E: choose   arrows or W, S: move"

    def _menu(self, player: SeatedPlayer) -> Menu:
        """Returns the player's menu with its current values and cursor."""
        consent = f"agree ({player.consent})" if player.consent else "ready, no consent record"
        items = [(consent, "ready"), ("enter consent record id", "consent")]
        if isinstance(player.device, Gamepad) and player.person:
            setup = self._setups[player.index]
            if setup.submenu is not None:
                setup.refresh(player.device, player.person.calibration)
                return setup.submenu
            items += setup.items(player.device, player.person.calibration)
        items += [("swap seats", "swap")] * self.game.settings.may_exchange_seats
        items += [("release this device", "leave"), ("quit", "quit")]
        menu = self._menus.setdefault(player.index, Menu("", items))
        menu.items = items
        menu.cursor = min(menu.cursor, len(items) - 1)
        return menu

    def _choose(self, player: SeatedPlayer, choice: str) -> None:
        game = self.game
        game.sounds.play("choose")
        match choice:
            case "ready":
                player.ready = True
                game.folder.journal("ready", player=player.player_id, consent=player.consent)
            case "consent":
                self.entry = TextEntry(f"Consent record id of {player.player_id}", 64)
                self._writer = player
            case "swap":
                self._swap()
            case "leave":
                if player.person:
                    player.person.device = None
            case "quit":
                self._quit = True
            case _:
                self._setups[player.index].choose(choice)

    def _escape(self) -> None:
        """Cancels open set-ups, where gamepad buttons give no commands; without one, quits."""
        busy = [setup for setup in self._setups.values() if setup.busy]
        for setup in busy:
            setup.cancel()
        self._quit = not busy

    def _swap(self) -> None:
        if self.game.exchange_seats():
            self.game.sounds.play("choose")

    def _close_entry(self) -> None:
        entry = self.entry
        if entry is None or not (entry.done or entry.cancelled):
            return
        if entry.done and self._writer is not None:
            text = entry.text.strip()
            if text and not text.replace("-", "").replace("_", "").replace(".", "").isalnum():
                self.game.show_message("use letters, digits, '.', '_' and '-': an id, not a name")
            else:
                self._writer.consent = text
        self.entry = None
