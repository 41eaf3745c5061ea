"""Allowed ranges of the numeric settings of a policy."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from copolicy.dataset.exceptions import InvalidValueError


class Bounds(NamedTuple):
    """Range of a finite number, and its description for error messages."""

    minimum: float
    maximum: float = math.inf
    expected: str = ""

    @property
    def text(self) -> str:
        """Description for error messages."""
        return self.expected or (
            f"at least {self.minimum:g}" if self.maximum == math.inf else f"{self.minimum:g} to {self.maximum:g}"
        )

    def contains(self, value: float) -> bool:
        """Whether a number is in the range; false for NaN and infinity."""
        return self.minimum <= value <= self.maximum and math.isfinite(value)


_TINY = math.ulp(0.0)  # excludes zero
_BELOW_ONE = math.nextafter(1.0, 0.0)
POSITIVE = Bounds(_TINY, expected="a number above 0")
FRACTION = Bounds(0, _BELOW_ONE, "0 or more and less than 1")


def require_bounds(settings: Any, bounds_of: Mapping[str, Bounds]) -> None:
    """Checks every setting in `bounds_of` that is not None.

    Raises:
        InvalidValueError: a number is out of range, NaN or infinite.
    """
    for name, bounds in bounds_of.items():
        value = getattr(settings, name)
        for number in value if isinstance(value, (tuple, list)) else (value,):
            if number is not None and not bounds.contains(number):
                raise InvalidValueError(name, bounds.text, value)
