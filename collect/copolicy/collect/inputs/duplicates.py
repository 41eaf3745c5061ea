"""Detects one device that the system lists twice: both entries give equal readings and simultaneous presses."""

from collections import defaultdict, deque

from .gamepads import InputSample

_MIN_CHANGES = 10  # two people do not make this many equal changes in a row
_MAX_TICKS = 1  # the two entries may be read in two pumps of the event queue
_MAX_NS = 60 * 10**6  # ticks of a slow loop are long
_LOGGED_PRESSES = 20  # per device


class DuplicateDetector:
    """Compares the readings of two devices over time.

    One entry may lag by a reading, so two readings differ only if each differs from the other's current and previous
    one.
    """

    def __init__(self):
        self._last: tuple[InputSample, InputSample] | None = None
        self._changes = 0
        self._differed = False

    @property
    def duplicate(self) -> bool:
        """The readings changed many times and never differed."""
        return not self._differed and self._changes >= _MIN_CHANGES

    def add(self, first: InputSample, second: InputSample) -> None:
        """Adds the readings of both devices at one moment."""
        last, self._last = self._last, (first, second)
        if last is None or self._differed:
            return
        now = (_reading(first), _reading(second))
        before = (_reading(last[0]), _reading(last[1]))
        self._differed = now[0] not in (now[1], before[1]) and now[1] not in (now[0], before[0])
        self._changes += not self._differed and now != before


class PressLog:
    """The button presses of each device; two devices with a press of only one of them are not duplicates."""

    def __init__(self):
        self._tick = 0
        self._presses: dict[int, deque[tuple[int, int]]] = defaultdict(lambda: deque(maxlen=_LOGGED_PRESSES))

    def tick(self) -> None:
        """Ends a tick, after all its events were added."""
        self._tick += 1

    def press(self, device: int, time_ns: int) -> None:
        """Adds a button press of a device."""
        self._presses[device].append((self._tick, time_ns))

    def simultaneous(self, device: int, partner: int) -> bool:
        """The last press of `device` coincides with a press of `partner` seen so far."""
        presses = self._presses[device]
        return bool(presses) and any(_coincide(presses[-1], press) for press in self._presses[partner])

    def settled(self, device: int) -> bool:
        """All presses that could coincide with the last one of a device have arrived."""
        presses = self._presses[device]
        return not presses or self._tick - presses[-1][0] > _MAX_TICKS

    def distinct(self, first: int, second: int) -> bool:
        """One of the devices was pressed without the other."""
        return self._alone(first, second) or self._alone(second, first)

    def _alone(self, device: int, partner: int) -> bool:
        return any(
            self._tick - press[0] > _MAX_TICKS and not any(_coincide(press, other) for other in self._presses[partner])
            for press in self._presses[device]
        )


def _coincide(first: tuple[int, int], second: tuple[int, int]) -> bool:
    return abs(first[0] - second[0]) <= _MAX_TICKS and abs(first[1] - second[1]) <= _MAX_NS


def _reading(sample: InputSample) -> tuple[tuple[float, ...], tuple[bool, ...]]:
    return sample.positions, sample.buttons
