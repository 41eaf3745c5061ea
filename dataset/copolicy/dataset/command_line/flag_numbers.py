"""Number flags whose bounds are checked before any work begins.

Each function returns the `type` of a flag. It raises InvalidValueError for NaN, a number out of bounds or other text;
argparse passes the error on and `commands.run` prints it as one line.
"""

import argparse
import math
from collections.abc import Callable

from ..exceptions import InvalidValueError

LARGEST_SEED = 2**32 - 1
"""Largest seed that the generators of numpy and LeRobot accept."""

MAX_COUNT = 10**6
"""Upper bound of counts such as episodes or steps; catches typing errors."""


def whole_number(flag: str, minimum: int | None = 1, maximum: int = MAX_COUNT) -> Callable[[str], int]:
    """A whole number from `minimum` to `maximum`; without `minimum` the command checks the lower bound itself."""

    def parse(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            raise InvalidValueError(flag, "a whole number", text) from None
        if minimum is not None and value < minimum:
            raise InvalidValueError(flag, f"at least {minimum}", value)
        if value > maximum:
            raise InvalidValueError(flag, f"at most {maximum}", value)
        return value

    return parse


def add_whole_number(
    parser: argparse.ArgumentParser,
    flag: str,
    help: str,
    default: int | None = None,
    minimum: int | None = 1,
    maximum: int = MAX_COUNT,
) -> None:
    """Adds a flag of type `whole_number`."""
    parser.add_argument(flag, type=whole_number(flag, minimum, maximum), default=default, help=help)


def number(
    flag: str, minimum: float = 0.0, maximum: float = math.inf, exclusive: bool = False
) -> Callable[[str], float]:
    """A finite number from `minimum` to `maximum`.

    Args:
        exclusive: `minimum` itself is not allowed.
    """

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            raise InvalidValueError(flag, "a number", text) from None
        if not value >= minimum or (exclusive and value == minimum):
            raise InvalidValueError(flag, f"a number {'above' if exclusive else 'of at least'} {minimum:g}", value)
        if not math.isfinite(value):
            raise InvalidValueError(flag, "a finite number", value)
        if value > maximum:
            raise InvalidValueError(flag, f"a number of at most {maximum:g}", value)
        return value

    return parse


def seed(flag: str = "--seed") -> Callable[[str], int]:
    """A seed of random generators."""
    return whole_number(flag, 0, LARGEST_SEED)


def workers(flag: str = "--workers") -> Callable[[str], int]:
    """A number of processes."""
    return whole_number(flag, 1, 1024)
