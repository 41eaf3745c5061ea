"""The lobby: join with a press, try the stick, set it up, agree."""

from dataclasses import replace

from ..inputs import CalibrationRun, Command, Pad, Press, StickCalibration
from ..inputs.calibration import DEAD_ZONES
from ..screen import Canvas
from ..screen.dialogs import draw_entry
from ..screen.lobby_view import LobbyPanel, draw_lobby
from ..ticker import Tick
from .game import Game
from .menu import Menu, TextEntry
from .phase import Phase, To
from .player import Player

_READY_TICKS = 15
_PROMPTS = {
    "rest": "calibrating: let go of the stick",
    "turn": "now turn it all the way round, twice",
}


class Lobby(Phase):
    """Both players get ready, each with their own menu."""

    def __init__(self, game: Game):
        super().__init__(game)
        self._menus: dict[int, Menu] = {}
        self._runs: dict[int, CalibrationRun] = {}
        self._writer: Player | None = None
        self._ready_ticks = 0
        self._left = False

    def enter(self) -> None:
        """Everybody has to agree anew; one who needs no lobby stays ready."""
        for player in self.game.players:
            player.ready = not player.spec.is_person

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
                game.sounds.play("go")
                joined.ready = False
                self._menus.pop(joined.index, None)
            elif press.command == Command.PAUSE and not press.moved:
                self._left = True
            return
        if press.moved:
            return  # trying the stick
        if player.index in self._runs:
            if press.command == Command.BACK:
                del self._runs[player.index]
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
            self._change(player, choice, 1 if press.command == Command.RIGHT else -1)
        elif menu.handle(press):
            self._choose(player, choice)

    def tick(self, tick: Tick) -> To:
        """Reads the sticks for the test and the calibrations."""
        game = self.game
        if self._left:
            game.stop = game.stop or "quit"
            return To.END
        self._take_entry()
        for player in game.players:
            run = self._runs.get(player.index)
            if run and player.person and player.device:
                run.add(player.person.sample().axes)
                if run.stage == "done":
                    del self._runs[player.index]
                    self._calibrate(player, run.result())
                    game.sounds.play("goal")
        if self.entry is None and all(player.ready and not player.missing for player in game.players):
            self._ready_ticks += 1
            if self._ready_ticks > _READY_TICKS:
                return To.READY
        else:
            self._ready_ticks = 0
        return To.STAY

    def device_lost(self, player: Player) -> None:
        """They have to join again."""
        player.ready = False
        self._runs.pop(player.index, None)

    def draw(self, canvas: Canvas, share: float) -> None:
        """Draws both panels."""
        game, settings = self.game, self.game.settings
        kept = game.folder.counts.kept_here.total()
        plan = [
            f"{settings.episodes} episodes to keep{f', {kept} kept already' if kept else ''}; {len(game.maps)} maps, "
            f"{settings.practice} practice episodes",
            "Carry the table to the green goal together. Nobody knows which way the other will go.",
        ]
        if game.folder.continued:
            plan[0] = f"{plan[0]} (continued)"
        seats = game.seats()
        panels = [self._panel(seat, player) for seat, player in enumerate(seats)]
        draw_lobby(canvas, f"Pair {settings.pair}", plan, panels)
        if self.entry:
            draw_entry(canvas, self.entry.title, self.entry.text)

    def _panel(self, seat: int, player: Player) -> LobbyPanel:
        waiting = "press any button of a joystick" if player.spec.kind == "joystick" else "press one of your keys"
        raw, force, dead_zone = None, (0.0, 0.0), 0.0
        if player.person and player.device:
            sample = player.person.sample()
            force = player.person.force(sample)
            calibration = player.person.calibration if isinstance(player.device, Pad) else StickCalibration()
            dead_zone = calibration.dead_zone if isinstance(player.device, Pad) else 0.0
            x, y = (sample.axes[axis] if axis < len(sample.axes) else 0.0 for axis in calibration.axes)
            raw = (x, y)
        run = self._runs.get(player.index)
        menu = self._menu(player) if player.person else None
        pad = isinstance(player.device, Pad)
        prompt = (
            _PROMPTS[run.stage] if run else "A: choose   B: next" if pad else "Enter or E: choose   arrows or W S: move"
        )
        return LobbyPanel(
            seat,
            player.player_id,
            "" if player.missing else player.label,
            waiting if player.missing else prompt,
            raw,
            force,
            dead_zone,
            menu.labels if menu and not player.missing else [],
            menu.cursor if menu else -1,
            player.ready and not player.missing,
            run.progress if run else None,
        )

    def _menu(self, player: Player) -> Menu:
        """The player's menu with its present values, its cursor kept."""
        consent = f"agree ({player.consent})" if player.consent else "ready, no consent record"
        items = [(consent, "ready"), ("write consent record id", "consent")]
        if isinstance(player.device, Pad) and player.person:
            calibration = player.person.calibration
            invert = ["yes" if one else "no" for one in calibration.invert]
            items += [
                ("calibrate the stick", "calibrate"),
                (f"dead zone  {calibration.dead_zone:.2f}", "dead_zone"),
                (f"left-right inverted: {invert[0]}", "invert_x"),
                (f"up-down inverted: {invert[1]}", "invert_y"),
            ]
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
            case "calibrate":
                if player.person:
                    self._runs[player.index] = CalibrationRun(player.person.calibration)
            case "swap":
                self._swap()
            case "leave":
                if player.person:
                    player.person.device = None
            case "quit":
                self._left = True
            case _:
                self._change(player, choice, 1)

    def _change(self, player: Player, choice: str, step: int) -> None:
        if not player.person or choice not in ("dead_zone", "invert_x", "invert_y"):
            return
        calibration = player.person.calibration
        x, y = calibration.invert
        match choice:
            case "dead_zone":
                smallest, largest = DEAD_ZONES
                steps = round((largest - smallest) / 0.01) + 1
                at = (round((calibration.dead_zone - smallest) / 0.01) + step) % steps
                changed = replace(calibration, dead_zone=round(smallest + 0.01 * at, 2))
            case "invert_x":
                changed = replace(calibration, invert=(not x, y))
            case _:
                changed = replace(calibration, invert=(x, not y))
        self._calibrate(player, changed)

    def _calibrate(self, player: Player, calibration: StickCalibration) -> None:
        try:
            self.game.roster.calibrate(player, calibration)
        except OSError as error:
            self.game.say(f"calibration not saved: {error.strerror}")

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
