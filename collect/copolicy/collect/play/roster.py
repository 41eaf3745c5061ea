"""Who holds what: joysticks and halves of the keyboard come, go and come back."""

from collections.abc import Callable

from ..inputs import CalibrationStore, KeyboardHalf, Pad, Pads, Press, StickCalibration
from .player import Player, keyboard_half


class Roster:
    """The two players and their devices.

    A device belongs to who pressed a button on it, by SDL's number of it: never by its place among the devices, and
    never by its make, which two of them may share.
    """

    def __init__(
        self, players: tuple[Player, Player], pads: Pads, store: CalibrationStore, journal: Callable[..., None]
    ):
        self.players = players
        self.pads = pads
        self._store = store
        self._journal = journal

    def player_of(self, press: Press) -> Player | None:
        """Whose device a press came from."""
        return next((one for one in self.players if one.device_id == press.device), None)

    def missing(self) -> list[Player]:
        """People without a device."""
        return [player for player in self.players if player.missing]

    def join(self, press: Press) -> Player | None:
        """Gives the device behind a press to the first person who waits for one of its kind.

        Returns:
            Who that is; None where the device is taken or nobody waits for it.
        """
        if press.moved or self.player_of(press):
            return None
        device = self.pads.get(press.device) if isinstance(press.device, int) else keyboard_half(press.device)
        return self.give(device) if device else None

    def give(self, device: Pad | KeyboardHalf) -> Player | None:
        """Gives a device to the first person who waits for one of its kind."""
        for player in self.players:
            if player.person and player.wants(device):
                player.person.device = device
                if isinstance(device, Pad):
                    player.person.calibration = self._store.get(device.guid)
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
