"""Who holds what: joysticks and halves of the keyboard come, go and come back."""

import time
from collections.abc import Callable

from ..inputs import (
    CalibrationStore,
    KeyboardHalf,
    Pad,
    Pads,
    Press,
    PressLog,
    StickCalibration,
    TwinWatch,
)
from ..inputs.gamepads import Labels
from .player import Player, keyboard_half


class Roster:
    """The two players and their devices.

    A device belongs to who pressed a button on it, by SDL's number of it: never by its place among the devices, and
    never by its make, which two of them may share. A second device joins once it was pressed without the first one:
    some drivers list one pad twice.

    Attributes:
        players: a and b.
        pads: that are plugged in.
        refused: what to tell a player whose device did not join; empty where there is nothing to tell.
    """

    def __init__(
        self,
        players: tuple[Player, Player],
        pads: Pads,
        store: CalibrationStore,
        journal: Callable[..., None],
        clock: Callable[[], int] = time.monotonic_ns,
    ):
        self.players = players
        self.pads = pads
        self.refused = ""
        self._store = store
        self._journal = journal
        self._clock = clock
        self._presses = PressLog()
        self._waiting: list[Pad] = []
        self._twins = TwinWatch()
        self._watched: tuple[Pad, Pad] | None = None

    def player_of(self, press: Press) -> Player | None:
        """Whose device a press came from."""
        return next((one for one in self.players if one.device_id == press.device), None)

    def missing(self) -> list[Player]:
        """People without a device."""
        return [player for player in self.players if player.missing]

    def note(self, press: Press) -> None:
        """Sees every press, for telling one device from another."""
        if isinstance(press.device, int) and not press.moved:
            self._presses.press(press.device, self._clock())

    def join(self, press: Press) -> Player | None:
        """Gives the device behind a press to the first person who waits for one of its kind.

        A joystick beside that of the other player may have to wait for two ticks, see `tick`.

        Returns:
            Who that is; None where the device is taken, cannot steer, has to wait, or nobody waits for it.
        """
        if press.moved or self.player_of(press):
            return None
        device = self.pads.get(press.device) if isinstance(press.device, int) else keyboard_half(press.device)
        if device is None or not any(player.wants(device) for player in self.players):
            return None
        if isinstance(device, Pad):
            if not device.steerings:
                self._refuse(device, f"{device.name} has neither a stick nor a d-pad: it cannot steer")
                return None
            if not all(self._presses.told_apart(device.instance_id, pad.instance_id) for pad in self._held()):
                self._waiting.append(device)
                return None
        return self.give(device)

    def tick(self) -> list[Player]:
        """Ends a tick; returns who joined now with a device that had to wait."""
        self._presses.tick()
        joined: list[Player] = []
        for pad in list(self._waiting):
            number = pad.instance_id
            if any(self._presses.together(number, held.instance_id) for held in self._held() if held is not pad):
                self._waiting.remove(pad)
                self._refuse(
                    pad,
                    f"{pad.name} and the other gamepad were pressed at once: press one alone, it may be listed twice",
                )
            elif self._presses.settled(number):
                self._waiting.remove(pad)
                player = self.give(pad) if self.pads.get(number) is pad else None
                joined += [player] if player else []
        return joined

    def watch(self) -> Player | None:
        """Looks at the devices between the episodes; once a tick.

        Returns:
            Who lost their device, since it is that of the other player, listed twice.
        """
        for player in self.players:
            if player.person:
                player.person.watch_rest()
        pads = self._held()
        if len(pads) < 2:
            return None
        first, second = pads
        if self._watched != (first, second):
            self._watched, self._twins = (first, second), TwinWatch()
        self._twins.add(first.sample(0), second.sample(0))
        if not self._twins.twins:
            return None
        self._watched = None
        self._refuse(second, f"{second.name} and {first.name} never differ: one gamepad is listed twice")
        return self.take_away(second)

    def give(self, device: Pad | KeyboardHalf) -> Player | None:
        """Gives a device that can steer to the first person who waits for one of its kind."""
        if isinstance(device, Pad) and not device.steerings:
            return None
        for player in self.players:
            if player.person and player.wants(device):
                player.person.device = device
                if isinstance(device, Pad):
                    player.person.calibration = self._store.of(device)
                self.refused = ""
                self._journal("join", player=player.player_id, device=player.label)
                return player
        return None

    def take_away(self, pad: Pad) -> Player | None:
        """A joystick is gone; returns whose it was."""
        for player in self.players:
            if player.person and player.device is pad:
                player.person.device = None
                self._journal("device_lost", player=player.player_id, device=pad.name)
                return player
        return None

    def calibrate(self, player: Player, calibration: StickCalibration) -> None:
        """Sets and keeps the calibration of a player's joystick, and of all others of its kind.

        Raises:
            OSError: it cannot be kept; it holds for this session.
        """
        device = player.device
        if not isinstance(device, Pad):
            return
        for one in self.players:
            if one.person and isinstance(one.device, Pad) and one.device.guid == device.guid:
                one.person.calibration = calibration
        self._store.put(device.guid, calibration)

    def labels(self) -> list[Labels]:
        """What is printed on the gamepads in hand, each kind once."""
        names = ("a", "b", "x", "y")
        return list({tuple(pad.labels[name] for name in names): pad.labels for pad in self._held()}.values())

    def hint(self, *actions: tuple[str, str, str]) -> str:
        """How to choose: each action by its control of a gamepad, its key and its word; for all devices in hand."""
        ways = [[labels[control] for control, _, _ in actions] for labels in self.labels()]
        if any(isinstance(player.device, KeyboardHalf) for player in self.players):
            ways.append([key for _, key, _ in actions])
        words = [word for _, _, word in actions]
        texts = ("   ".join(f"{how} {word}" for how, word in zip(way, words, strict=True) if how) for way in ways)
        return "     |     ".join(texts)

    def is_stray(self, press: Press) -> bool:
        """A press came from a joystick that nobody holds, in a session of joysticks: a spare one, or a copy."""
        joysticks = any(player.spec.kind == "joystick" for player in self.players)
        return isinstance(press.device, int) and joysticks and self.player_of(press) is None

    def _held(self) -> list[Pad]:
        return [player.device for player in self.players if isinstance(player.device, Pad)]

    def _refuse(self, pad: Pad, why: str) -> None:
        self.refused = why
        self._journal("refused", device=pad.name, reason=why)
