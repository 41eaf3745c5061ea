"""A stick that pushes while nobody touches it."""

import math

_STILL = 0.02  # of a full force: nearer to each other readings are of a stick that nobody moves
_GENTLE = 0.35  # of a full force: beyond it a stick is held, unless it was never seen at rest


class RestWatch:
    """Follows the force of one device, a reading a tick, and notices that it does not rest at zero.

    A hand that holds a stick trembles, or lets go of it. A device whose centre was measured is doubted only after a
    longer time, and within an episode not at all: people do hold a stick then.

    Attributes:
        push: size of the force at rest; 0 while there is none.
    """

    BETWEEN, MEASURED, CARRYING = 15, 60, 30
    """How many readings a stick has to be still: between episodes, one that was calibrated, and within an episode."""

    def __init__(self):
        self.push = 0.0
        self._centred = False
        self._first = (0.0, 0.0)
        self._count = 0

    def add(self, force: tuple[float, float], still: int) -> None:
        """Takes the force of a moment; `still` is one of the numbers of readings above."""
        if self._count and math.dist(force, self._first) <= _STILL:
            self._count += 1
        else:
            self._first, self._count = force, 1
        if self._count < still:
            return
        size = math.hypot(*self._first)
        if size == 0:
            self._centred, self.push = True, 0.0
        elif size < _GENTLE or not (self._centred or still == self.CARRYING):
            self.push = size
