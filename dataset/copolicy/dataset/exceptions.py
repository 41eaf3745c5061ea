"""Errors that a user can act on: one line each with the file or value, what was expected and what was found."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any


class CopolicyError(Exception):
    """Base class of all errors that copolicy raises on purpose.

    `exit_status` is the exit status of a command: 2 if the call or its input is wrong, 1 if the data or the run has a
    problem.
    """

    exit_status = 2

    def __reduce__(self) -> tuple[Any, ...]:
        # Subclasses build the message from their arguments; an error from a worker process already has its message.
        return _with_message, (type(self), self.args)


class ShapeError(CopolicyError):
    """An array has the wrong shape."""

    def __init__(self, name: str, expected: tuple[int | str, ...], actual: tuple[int, ...]):
        super().__init__(f"{name}: expected shape {_shape(expected)}, got {_shape(actual)}")


class InvalidValueError(CopolicyError):
    """A value is not allowed."""

    def __init__(self, name: str, expected: str, actual: object):
        super().__init__(f"{name}: expected {expected}, found {actual!r}")


class UnknownNameError(CopolicyError):
    """A name is unknown; the message lists the available names."""

    def __init__(self, kind: str, name: str, available: Iterable[str]):
        super().__init__(f"unknown {kind} {name!r}; available: {', '.join(sorted(available))}")


class FileFormatError(CopolicyError):
    """A file has the wrong format or content."""

    def __init__(self, path: Path | str, expected: str, actual: str):
        super().__init__(f"{path}: expected {expected}, found {actual}")


class ForeignRecordingError(FileFormatError):
    """An undamaged file that is not a recording of this task, or has an unknown schema version."""


class OutputExistsError(CopolicyError):
    """An output path exists already."""

    def __init__(self, path: Path | str):
        super().__init__(f"{path}: expected a path that does not exist yet, found one; nothing was overwritten")


class MissingExtraError(CopolicyError):
    """A package that a command needs is not installed."""

    def __init__(self, package: str, extra: str = "train"):
        super().__init__(
            f"{package} is not installed: this command needs the extra, pip install 'lerobot_policy_copolicy[{extra}]'"
        )


class RunError(CopolicyError):
    """The call is valid, but the data or the run has a problem."""

    exit_status = 1


def _with_message(error_type: type[CopolicyError], args: tuple) -> CopolicyError:
    return error_type.__new__(error_type, *args)


def _shape(shape: tuple[int | str, ...]) -> str:
    return "(" + ", ".join(str(size) for size in shape) + ("," if len(shape) == 1 else "") + ")"
