"""Numbers of the command line, held against their bounds before any work begins.

Each function makes the `type` of a flag, which raises InvalidValueError for another number, NaN, or no number: argparse
passes it on, and `commandline.run` makes it one line.
"""

import argparse
import math
from collections.abc import Callable

from ..exceptions import InvalidValueError

LARGEST_SEED = 2**32 - 1
"""The largest that numpy's and LeRobot's generators take."""

MOST = 10**6
"""Episodes, steps, plans or processes of one call; more are a slip of the hand."""


def whole_number(flag: str, least: int | None = 1, most: int = MOST) -> Callable[[str], int]:
    """A whole number from `least` to `most`; without `least` the command looks at that side itself."""

    def parse(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            raise InvalidValueError(flag, "a whole number", text) from None
        if least is not None and value < least:
            raise InvalidValueError(flag, f"at least {least}", value)
        if value > most:
            raise InvalidValueError(flag, f"at most {most}", value)
        return value

    return parse


def add_whole_number(
    command: argparse.ArgumentParser,
    flag: str,
    meaning: str,
    default: int | None = None,
    least: int | None = 1,
    most: int = MOST,
) -> None:
    """Adds a flag of a `whole_number`."""
    command.add_argument(flag, type=whole_number(flag, least, most), default=default, help=meaning)


def number(flag: str, least: float = 0.0, most: float = math.inf, above: bool = False) -> Callable[[str], float]:
    """A finite number from `least` to `most`.

    Args:
        above: `least` itself is too small.
    """

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            raise InvalidValueError(flag, "a number", text) from None
        if not value >= least or (above and value == least):
            raise InvalidValueError(flag, f"a number {'above' if above else 'of at least'} {least:g}", value)
        if not math.isfinite(value):
            raise InvalidValueError(flag, "a finite number", value)
        if value > most:
            raise InvalidValueError(flag, f"a number of at most {most:g}", value)
        return value

    return parse


def seed(flag: str = "--seed") -> Callable[[str], int]:
    """A seed of everything that is drawn."""
    return whole_number(flag, 0, LARGEST_SEED)


def workers(flag: str = "--workers") -> Callable[[str], int]:
    """A number of processes."""
    return whole_number(flag, 1, 1024)
