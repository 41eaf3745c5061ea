"""The lobby: join with a press, try the stick, set it up, agree."""

from ..inputs import Command, Pad, Press
from ..screen import Canvas
from ..screen.dialogs import draw_entry
from ..screen.lobby_view import LobbyPanel, draw_lobby
from ..sdl import pygame
from ..ticker import Tick
from .game import Game
from .menu import Menu, TextEntry
from .phase import Phase, To
from .player import Player
from .stick_setup import StickSetup

_READY_TICKS = 15


class Lobby(Phase):
    """Both players get ready, each with their own menu."""

    def __init__(self, game: Game):
        super().__init__(game)
        self._menus: dict[int, Menu] = {}
        self._setups = {player.index: StickSetup(game, player) for player in game.players}
        self._writer: Player | None = None
        self._ready_ticks = 0
        self._left = False

    def enter(self) -> None:
        """Everybody has to agree anew; one who needs no lobby stays ready."""
        for player in self.game.players:
            player.ready = not player.spec.is_person

    def takes(self, event: pygame.event.Event) -> bool:
        """The gamepad's events while its buttons are set up."""
        return any(setup.takes(event) for setup in self._setups.values())

    def handle(self, press: Press) -> None:
        """Joins, or moves in the own menu."""
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
        if press.moved or self._tries_cross(player, press):
            return  # trying the stick
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
        if press.command == Command.BACK:  # the way through the menu with two buttons
            menu.cursor = (menu.cursor + 1) % len(menu.items)
            return
        choice = menu.items[menu.cursor][1]
        if press.command in (Command.LEFT, Command.RIGHT):
            setup.change(choice, 1 if press.command == Command.RIGHT else -1)
        elif menu.handle(press):
            self._choose(player, choice)

    def tick(self, tick: Tick) -> To:
        """Reads the sticks for the test and the calibrations."""
        game = self.game
        if self._left:
            game.stop = game.stop or "quit"
            return To.END
        self._take_entry()
        for setup in self._setups.values():
            if setup.tick():
                game.sounds.play("goal")
            if setup.message:
                game.say(setup.message)
                setup.message = ""
        if self.entry is None and all(player.ready and not player.missing for player in game.players):
            self._ready_ticks += 1
            if self._ready_ticks > _READY_TICKS:
                return To.READY
        else:
            self._ready_ticks = 0
        return To.STAY

    def joined(self, player: Player) -> None:
        """They have a device, and a menu for it."""
        self.game.sounds.play("go")
        player.ready = False
        self._menus.pop(player.index, None)
        self._setups[player.index].cancel()

    def device_lost(self, player: Player) -> None:
        """They have to join again."""
        player.ready = False
        self._setups[player.index].cancel()

    def draw(self, canvas: Canvas, share: float) -> None:
        """Draws both panels."""
        game, settings = self.game, self.game.settings
        kept = game.folder.counts.kept_here.total()
        plan = [
            f"{settings.episodes} episodes to keep{f', {kept} kept already' if kept else ''}; {len(game.maps)} maps, "
            f"{settings.practice} practice episodes",
            game.task.words.instruction or game.task.spec.sentence,
        ]
        if game.folder.continued:
            plan[0] = f"{plan[0]} (continued)"
        seats = game.seats()
        panels = [self._panel(seat, player) for seat, player in enumerate(seats)]
        draw_lobby(canvas, f"Pair {settings.pair}", plan, panels)
        if self.entry:
            draw_entry(canvas, self.entry.title, self.entry.text)

    def _panel(self, seat: int, player: Player) -> LobbyPanel:
        if player.missing:
            joystick = player.spec.kind == "joystick"
            waiting = "press any button of a joystick" if joystick else "press one of your keys"
            refused = self.game.roster.refused if joystick else ""
            return LobbyPanel(seat, player.player_id, waiting, notice=refused)
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
        if isinstance(device, Pad):
            calibration = player.person.calibration
            x, y = (sample.positions[axis] for axis in calibration.axes)
            panel.stick, panel.dead_zone = (x, y), calibration.dead_zone
            panel.steering = device.steering(calibration).label
        else:
            panel.stick, panel.steering = (sample.axes[0], sample.axes[1]), "keys"
        return panel

    def _tries_cross(self, player: Player, press: Press) -> bool:
        """A direction of the d-pad that steers commands nothing here, as a stick's does not."""
        pad, directions = player.device, (Command.UP, Command.DOWN, Command.LEFT, Command.RIGHT)
        if press.command not in directions or not isinstance(pad, Pad) or player.person is None:
            return False
        return pad.steering(player.person.calibration).digital

    def _prompt(self, player: Player) -> str:
        setup = self._setups[player.index]
        if setup.busy:
            return setup.prompt
        if isinstance(player.device, Pad):
            labels = player.device.labels
            return f"{labels['a']}: choose   {labels['b']}: next"
        return "Enter or E: choose   arrows or W S: move"

    def _menu(self, player: Player) -> Menu:
        """The player's menu with its present values, its cursor kept."""
        consent = f"agree ({player.consent})" if player.consent else "ready, no consent record"
        items = [(consent, "ready"), ("write consent record id", "consent")]
        if isinstance(player.device, Pad) and player.person:
            setup = self._setups[player.index]
            if setup.submenu is not None:
                setup.refresh(player.device, player.person.calibration)
                return setup.submenu
            items += setup.items(player.device, player.person.calibration)
        items += [("swap seats", "swap"), ("leave", "leave"), ("quit", "quit")]
        menu = self._menus.setdefault(player.index, Menu("", items))
        menu.items = items
        menu.cursor = min(menu.cursor, len(items) - 1)
        return menu

    def _choose(self, player: Player, choice: str) -> None:
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
                self._left = True
            case _:
                self._setups[player.index].choose(choice)

    def _escape(self) -> None:
        """Leaves the set-up of buttons, which takes those of the gamepad, or else the lobby."""
        busy = [setup for setup in self._setups.values() if setup.busy]
        for setup in busy:
            setup.cancel()
        self._left = not busy

    def _swap(self) -> None:
        self.game.reseat()
        self.game.sounds.play("choose")

    def _take_entry(self) -> None:
        entry = self.entry
        if entry is None or not (entry.done or entry.left):
            return
        if entry.done and self._writer is not None:
            text = entry.text.strip()
            if text and not text.replace("-", "").replace("_", "").replace(".", "").isalnum():
                self.game.say("letters, digits, '.', '_' and '-' only: an id, no name")
            else:
                self._writer.consent = text
        self.entry = None
