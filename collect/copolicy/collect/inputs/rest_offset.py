"""Detects a stick that gives a force while nobody touches it."""

import math

_STILL = 0.02  # full forces; readings within this distance come from a stick that nobody moves
_MAX_OFFSET = 0.35  # full forces; beyond it, the stick is held, unless it was never seen at rest


class RestOffsetDetector:
    """Follows the force of one device, a reading a tick, and detects a force at rest that is not zero.

    A stick that is held moves slightly or is let go. If the device's centre was measured, more still readings are
    needed, and none are taken during an episode, where people do hold a stick still.

    Attributes:
        force: size of the force at rest; 0 if none was detected.
    """

    UNMEASURED, MEASURED, IN_EPISODE = 15, 60, 30
    """Still readings needed: between episodes before and after a calibration, and during an episode."""

    def __init__(self):
        self.force = 0.0
        self._centred = False
        self._first = (0.0, 0.0)
        self._count = 0

    def add(self, force: tuple[float, float], still: int) -> None:
        """Adds the force of a reading; `still` is one of the numbers of readings above."""
        if self._count and math.dist(force, self._first) <= _STILL:
            self._count += 1
        else:
            self._first, self._count = force, 1
        if self._count < still:
            return
        size = math.hypot(*self._first)
        if size == 0:
            self._centred, self.force = True, 0.0
        elif size < _MAX_OFFSET or not (self._centred or still == self.IN_EPISODE):
            self.force = size
