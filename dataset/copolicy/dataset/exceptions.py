"""Errors that a user can act on: one line each, naming the thing, what was expected and what was found."""

from collections.abc import Iterable
from pathlib import Path


class CopolicyError(Exception):
    """Base of every error that copolicy raises on purpose.

    `exit_status` is what a command returns for it: 2 where the call or its input is wrong,
    1 where the data or the run has a problem.
    """

    exit_status = 2

    def __reduce__(self):
        # Children build the message from other arguments; an error that comes out of a worker process has it already.
        return _with_message, (type(self), self.args)


class ShapeError(CopolicyError):
    """An array of another shape than the one promised."""

    def __init__(self, name: str, expected: tuple[int | str, ...], given: tuple[int, ...]):
        super().__init__(f"{name}: expected shape {_shape(expected)}, got {_shape(given)}")


class InvalidValueError(CopolicyError):
    """A value outside what is allowed."""

    def __init__(self, name: str, expected: str, found: object):
        super().__init__(f"{name}: expected {expected}, found {found!r}")


class UnknownNameError(CopolicyError):
    """A name that is not among those on offer; the message lists what is."""

    def __init__(self, kind: str, name: str, available: Iterable[str]):
        super().__init__(f"unknown {kind} {name!r}; available: {', '.join(sorted(available))}")


class FileFormatError(CopolicyError):
    """A file that is not what it should be."""

    def __init__(self, path: Path | str, expected: str, found: str):
        super().__init__(f"{path}: expected {expected}, found {found}")


class ForeignRecordingError(FileFormatError):
    """A sound file that holds no recording of this task, or one of a version that this reader does not know."""


class OutputExistsError(CopolicyError):
    """An output that would overwrite something."""

    def __init__(self, path: Path | str):
        super().__init__(f"{path}: expected a path that does not exist yet, found one; nothing was overwritten")


class MissingExtraError(CopolicyError):
    """A command whose packages were not installed."""

    def __init__(self, package: str, extra: str = "train"):
        super().__init__(
            f"{package} is not installed: this command needs the extra, pip install 'lerobot_policy_copolicy[{extra}]'"
        )


class RunError(CopolicyError):
    """The call was right, but the data or the run has a problem."""

    exit_status = 1


def _with_message(kind: type[CopolicyError], args: tuple) -> CopolicyError:
    return kind.__new__(kind, *args)


def _shape(shape: tuple[int | str, ...]) -> str:
    return "(" + ", ".join(str(size) for size in shape) + ("," if len(shape) == 1 else "") + ")"
