"""The players and their devices: gamepads and halves of the keyboard are assigned, lost and assigned again."""

import time
from collections.abc import Callable

from ..inputs import (
    HALVES,
    CalibrationStore,
    DuplicateDetector,
    Gamepad,
    Gamepads,
    KeyboardHalf,
    Press,
    PressLog,
    StickCalibration,
)
from ..inputs.mapping import Labels
from .player import SeatedPlayer


class Roster:
    """The two players and their devices.

    A device is assigned to the player who presses a button on it, by SDL's instance id: not by its index, and not by
    its model, which two devices may share. A second gamepad joins only after a press without the first one, since some
    drivers list one gamepad twice.

    Attributes:
        players: a and b.
        gamepads: that are connected.
        refusal: message for a player whose device could not join; empty if there is none.
    """

    def __init__(
        self,
        players: tuple[SeatedPlayer, SeatedPlayer],
        gamepads: Gamepads,
        store: CalibrationStore,
        journal: Callable[..., None],
        clock: Callable[[], int] = time.monotonic_ns,
    ):
        self.players = players
        self.gamepads = gamepads
        self.refusal = ""
        self._store = store
        self._journal = journal
        self._clock = clock
        self._presses = PressLog()
        self._waiting: list[Gamepad] = []
        self._duplicates = DuplicateDetector()
        self._compared: tuple[Gamepad, Gamepad] | None = None

    def player_of(self, press: Press) -> SeatedPlayer | None:
        """Returns the player whose device gave a press, or None."""
        return next((player for player in self.players if player.device_id == press.device), None)

    def without_device(self) -> list[SeatedPlayer]:
        """Returns the people without a device."""
        return [player for player in self.players if player.lacks_device]

    def log_press(self, press: Press) -> None:
        """Logs a press, to detect a gamepad that is listed twice; needs every press."""
        if isinstance(press.device, int) and not press.moved:
            self._presses.press(press.device, self._clock())

    def join(self, press: Press) -> SeatedPlayer | None:
        """Assigns the device of a press to the first person who needs a device of its kind.

        A second gamepad may have to wait for two ticks, see `tick`.

        Returns:
            The player; None if the device is in use, cannot steer, has to wait, or is not needed.
        """
        if press.moved or self.player_of(press):
            return None
        device = self.gamepads.get(press.device) if isinstance(press.device, int) else HALVES.get(press.device)
        if device is None or not any(player.can_use(device) for player in self.players):
            return None
        if isinstance(device, Gamepad):
            if not device.steering_options:
                self._refuse(device, f"{device.name} has neither a stick nor a d-pad: it cannot steer")
                return None
            used = self._gamepads_in_use()
            if not all(self._presses.distinct(device.instance_id, gamepad.instance_id) for gamepad in used):
                self._waiting.append(device)
                return None
        return self.assign(device)

    def tick(self) -> list[SeatedPlayer]:
        """Ends a tick; returns the players who joined with a gamepad that had to wait."""
        self._presses.tick()
        joined: list[SeatedPlayer] = []
        for gamepad in list(self._waiting):
            number = gamepad.instance_id
            partners = [used.instance_id for used in self._gamepads_in_use() if used is not gamepad]
            if any(self._presses.simultaneous(number, partner) for partner in partners):
                self._waiting.remove(gamepad)
                reason = "and the other gamepad were pressed at once: press one alone, it may be listed twice"
                self._refuse(gamepad, f"{gamepad.name} {reason}")
            elif self._presses.settled(number):
                self._waiting.remove(gamepad)
                player = self.assign(gamepad) if self.gamepads.get(number) is gamepad else None
                joined += [player] if player else []
        return joined

    def check_devices(self) -> SeatedPlayer | None:
        """Checks the devices for faults; called once a tick between episodes.

        Returns:
            The player whose device was removed because it is the partner's, listed twice; else None.
        """
        for player in self.players:
            if player.person:
                player.person.watch_rest()
        gamepads = self._gamepads_in_use()
        if len(gamepads) < 2:
            return None
        first, second = gamepads
        if self._compared != (first, second):
            self._compared, self._duplicates = (first, second), DuplicateDetector()
        self._duplicates.add(first.sample(0), second.sample(0))
        if not self._duplicates.duplicate:
            return None
        self._compared = None
        self._refuse(second, f"{second.name} and {first.name} never differ: one gamepad is listed twice")
        return self.release(second)

    def assign(self, device: Gamepad | KeyboardHalf) -> SeatedPlayer | None:
        """Assigns a device that can steer to the first person who needs one of its kind; returns the player."""
        if isinstance(device, Gamepad) and not device.steering_options:
            return None
        for player in self.players:
            if player.person and player.can_use(device):
                player.person.device = device
                if isinstance(device, Gamepad):
                    player.person.calibration = self._store.for_gamepad(device)
                self.refusal = ""
                self._journal("join", player=player.player_id, device=player.label)
                return player
        return None

    def release(self, gamepad: Gamepad) -> SeatedPlayer | None:
        """Removes a gamepad from the player who used it; returns the player."""
        for player in self.players:
            if player.person and player.device is gamepad:
                player.person.device = None
                self._journal("device_lost", player=player.player_id, device=gamepad.name)
                return player
        return None

    def calibrate(self, player: SeatedPlayer, calibration: StickCalibration) -> None:
        """Sets and stores the calibration of a player's gamepad, and of the partner's if it is the same model.

        Raises:
            OSError: it cannot be stored; it applies to this session only.
        """
        device = player.device
        if not isinstance(device, Gamepad):
            return
        for user in self.players:
            if user.person and isinstance(user.device, Gamepad) and user.device.guid == device.guid:
                user.person.calibration = calibration
        self._store.put(device.guid, calibration)

    def labels(self) -> list[Labels]:
        """Returns the button labels of the gamepads in use, each set of labels once."""
        names, used = ("a", "b", "x", "y"), self._gamepads_in_use()
        return list({tuple(gamepad.labels[name] for name in names): gamepad.labels for gamepad in used}.values())

    def hint(self, *actions: tuple[str, str, str]) -> str:
        """Returns a line with the buttons and keys of some actions, for the devices in use.

        Args:
            actions: each a gamepad control, a key and the action's name.
        """
        bindings = [[labels[control] for control, _, _ in actions] for labels in self.labels()]
        if any(isinstance(player.device, KeyboardHalf) for player in self.players):
            bindings.append([key for _, key, _ in actions])
        names = [name for _, _, name in actions]
        texts = ("   ".join(f"{key} {name}" for key, name in zip(keys, names, strict=True) if key) for keys in bindings)
        return "     |     ".join(texts)

    def is_unassigned(self, press: Press) -> bool:
        """Whether a press came from a gamepad of no player, in a session that uses gamepads: a spare or a duplicate."""
        expected = any(player.spec.kind == "joystick" for player in self.players)
        return isinstance(press.device, int) and expected and self.player_of(press) is None

    def _gamepads_in_use(self) -> list[Gamepad]:
        return [player.device for player in self.players if isinstance(player.device, Gamepad)]

    def _refuse(self, gamepad: Gamepad, reason: str) -> None:
        self.refusal = reason
        self._journal("refused", device=gamepad.name, reason=reason)
