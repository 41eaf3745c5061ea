"""A stick that pushes while nobody touches it."""

import math

_STILL = 0.02  # of a full force: nearer to each other readings are of a stick that nobody moves
_SAMPLES = 15  # half a second
_PLAYED_SAMPLES = 30
_GENTLE = 0.35  # of a full force: beyond it a stick is held, unless it was never seen at rest


class RestWatch:
    """Follows the force of one device at 30 Hz and notices that it does not rest at zero.

    A hand that holds a stick trembles, or lets go of it. While a table is carried only a device that was never
    calibrated is doubted, and only after a second: people do hold a stick then.

    Attributes:
        push: size of the force at rest; 0 while there is none.
    """

    def __init__(self):
        self.push = 0.0
        self._centred = False
        self._first = (0.0, 0.0)
        self._count = 0

    def add(self, force: tuple[float, float], played: bool = False) -> None:
        """Takes the force of a moment; `played` while a table is carried by a device that was never calibrated."""
        if self._count and math.dist(force, self._first) <= _STILL:
            self._count += 1
        else:
            self._first, self._count = force, 1
        if self._count < (_PLAYED_SAMPLES if played else _SAMPLES):
            return
        size = math.hypot(*self._first)
        if size == 0:
            self._centred, self.push = True, 0.0
        elif size < _GENTLE or not (self._centred or played):
            self.push = size
