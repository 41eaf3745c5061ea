"""One device that the system lists twice: the two never differ, and a press on one is a press on both."""

from collections import defaultdict, deque

from .joysticks import InputSample

_CHANGES = 10  # alike and one after the other: two hands do not do that
_TOGETHER = 1  # ticks: two copies may be read in two pumps of the event queue
_TOGETHER_NS = 60 * 10**6  # a slow loop has long ticks
_KEPT = 20  # presses of a device


class TwinWatch:
    """Compares what two devices say, moment by moment.

    A copy may lag a moment behind, so a reading differs only where it is neither that of the other one nor its last.
    """

    def __init__(self):
        self._last: tuple[InputSample, InputSample] | None = None
        self._changes = 0
        self._differed = False

    @property
    def twins(self) -> bool:
        """They changed many times and never differed."""
        return not self._differed and self._changes >= _CHANGES

    def add(self, first: InputSample, second: InputSample) -> None:
        """Takes what both say at one moment."""
        last, self._last = self._last, (first, second)
        if last is None or self._differed:
            return
        now = (_said(first), _said(second))
        before = (_said(last[0]), _said(last[1]))
        self._differed = now[0] not in (now[1], before[1]) and now[1] not in (now[0], before[0])
        self._changes += not self._differed and now != before


class PressLog:
    """When which device was pressed: a device that was pressed without another is no copy of it."""

    def __init__(self):
        self._tick = 0
        self._presses: dict[int, deque[tuple[int, int]]] = defaultdict(lambda: deque(maxlen=_KEPT))

    def tick(self) -> None:
        """The events of a tick have been seen."""
        self._tick += 1

    def press(self, device: int, time_ns: int) -> None:
        """A button of a device went down."""
        self._presses[device].append((self._tick, time_ns))

    def together(self, device: int, other: int) -> bool:
        """The last press of a device was one of the other, too, as far as can be told yet."""
        presses = self._presses[device]
        return bool(presses) and any(_near(presses[-1], one) for one in self._presses[other])

    def settled(self, device: int) -> bool:
        """Whatever belongs to the last press of a device has arrived."""
        presses = self._presses[device]
        return not presses or self._tick - presses[-1][0] > _TOGETHER

    def told_apart(self, device: int, other: int) -> bool:
        """One of them was pressed without the other."""
        return self._alone(device, other) or self._alone(other, device)

    def _alone(self, device: int, other: int) -> bool:
        return any(
            self._tick - press[0] > _TOGETHER and not any(_near(press, one) for one in self._presses[other])
            for press in self._presses[device]
        )


def _near(press: tuple[int, int], other: tuple[int, int]) -> bool:
    return abs(press[0] - other[0]) <= _TOGETHER and abs(press[1] - other[1]) <= _TOGETHER_NS


def _said(sample: InputSample) -> tuple[tuple[float, ...], tuple[bool, ...]]:
    return sample.positions, sample.buttons
