"""Shared by the commands of all rooms: common flags, exit status, progress bars, one-line errors."""

import argparse
import contextlib
import io
import json
import logging
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib.metadata import version
from typing import Any, TextIO

from tqdm import tqdm

from ..exceptions import CopolicyError
from ..files.staging import disk_error_number, error_chain
from .extras import missing_extra_error, require_packages

DISTRIBUTION = "lerobot_policy_copolicy"
"""Name of the installed distribution."""

type Commands = "argparse._SubParsersAction[argparse.ArgumentParser]"
"""Where the commands of a script are added."""

Handler = Callable[[argparse.Namespace], dict]
"""Runs a command: takes the parsed flags, returns a summary that JSON can store."""

Needs = Sequence[str] | Callable[[argparse.Namespace], Sequence[str]]
"""Packages of extras that a command imports (see `extras`), or a function that lists them for the parsed flags."""


def command_parser(prog: str, description: str) -> tuple[argparse.ArgumentParser, Commands]:
    """Returns the parser of a room's script and the object that its commands are added to.

    Flags cannot be abbreviated, here and in the commands: `--map 3` must not be `--maps 3` where there is no `--map`.
    """
    parser = argparse.ArgumentParser(prog=prog, description=description, allow_abbrev=False)
    add_version_flag(parser)
    return parser, parser.add_subparsers(dest="command", required=True, metavar="COMMAND")


def add_version_flag(parser: argparse.ArgumentParser) -> None:
    """Adds `--version`, which prints the installed release."""
    parser.add_argument("--version", action="version", version=f"%(prog)s {version(DISTRIBUTION)}")


def add_command(
    commands: Commands, name: str, handler: Handler, help: str, example: str, needs: Needs = ()
) -> argparse.ArgumentParser:
    """Adds a command with `--json`, `--debug` and an example at the end of its `--help`.

    Args:
        needs: packages that are checked before the handler is called.
    """
    parser = commands.add_parser(
        name,
        help=help,
        description=help,
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add_common_flags(parser)
    parser.set_defaults(handler=handler, needs=needs, parser=parser)
    return parser


def add_group(commands: Commands, name: str, help: str, description: str, examples: Sequence[str]) -> Commands:
    """Adds a command with sub-commands; `add_command` adds them to the returned object."""
    parser = commands.add_parser(
        name,
        help=help,
        description=description,
        epilog="\n  ".join(("example:", *examples)),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    return parser.add_subparsers(dest="step", required=True, metavar="STEP")


def add_common_flags(parser: argparse.ArgumentParser) -> None:
    """Adds `--json` and `--debug`."""
    parser.add_argument("--json", action="store_true", help="print one JSON object on stdout; logs go to stderr")
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")


def run(parser: argparse.ArgumentParser, argv: Sequence[str] | None = None) -> int:
    """Parses the flags, runs the handler, prints its summary and returns the exit status (0, 1 or 2).

    A summary may contain `exit_status`, 1 where the work was done but its result is a finding. If the reader of the
    output, such as `head`, closes the pipe early, the command still completes without an error.
    """
    with tolerate_closed_pipes():
        logging.basicConfig(level=logging.INFO, stream=sys.stderr, format="%(message)s")
        try:
            arguments, unknown = parser.parse_known_args(argv)
            if unknown:  # with the usage of the command, which parse_args does not show
                getattr(arguments, "parser", parser).error(f"unrecognized arguments: {' '.join(unknown)}")
        except CopolicyError as error:  # raised by a flag's `type` function
            print(f"{parser.prog}: {error}", file=sys.stderr)
            return error.exit_status
        return _run_handler(parser.prog, arguments)


def _run_handler(prog: str, arguments: argparse.Namespace) -> int:
    try:
        needs: Needs = getattr(arguments, "needs", ())
        require_packages(*(needs(arguments) if callable(needs) else needs))
        try:
            summary = dict(arguments.handler(arguments))
        except ImportError as error:
            if missing := missing_extra_error(error):
                raise missing from error
            raise
    except CopolicyError as error:
        if arguments.debug:
            raise
        print(f"{prog}: {error}", file=sys.stderr)
        return error.exit_status
    except KeyboardInterrupt:
        print(f"{prog}: stopped", file=sys.stderr)
        return 130
    except Exception as error:
        line = system_line(error)
        if arguments.debug or line is None:
            raise
        print(f"{prog}: {line}", file=sys.stderr)
        return 1
    status = int(summary.pop("exit_status", 0))
    for line in [json.dumps(summary, indent=2)] if arguments.json else _lines(summary):
        print(line)
    return status


def system_line(error: BaseException) -> str | None:
    """Describes a system error in one line with its path; None for any other error.

    Libraries wrap system errors: h5py and pyarrow raise an OSError without number and path, safetensors and torch
    raise other types.
    """
    number = disk_error_number(error)
    if number is None and not isinstance(error, OSError):
        return None
    texts = (error.strerror, " ".join(str(error).split())) if isinstance(error, OSError) else ()
    text = os.strerror(number) if number is not None else next(filter(None, texts), type(error).__name__)
    chain = error_chain(error) if number is not None else (error,)
    paths = (getattr(cause, "filename", None) for cause in chain)
    path = next((path for path in paths if isinstance(path, (str, bytes, os.PathLike))), None)
    return text if path is None else f"{os.fsdecode(path)}: {text}"


def progress[Item](items: Iterable[Item], total: int | None, label: str) -> Iterable[Item]:
    """Iterates over items with a progress bar."""
    with progress_bar(total, label) as bar:
        for item in items:
            yield item
            bar.update()


def progress_bar(total: int | None, label: str) -> "tqdm[Any]":
    """A progress bar on stderr, shown if stderr is a terminal or `COPOLICY_PROGRESS=1`."""
    shown = sys.stderr.isatty() or os.environ.get("COPOLICY_PROGRESS") == "1"
    return tqdm(total=total, desc=label, disable=not shown, file=sys.stderr, mininterval=0.5)


def _lines(summary: dict, indent: str = "") -> Iterable[str]:
    width = max((len(str(key)) for key in summary), default=0)
    for key, value in summary.items():
        if isinstance(value, (dict, list, tuple)) and not value:
            yield f"{indent}{key:<{width}}  none"
        elif isinstance(value, dict):
            yield f"{indent}{key}"
            yield from _lines(value, indent + "  ")
        elif isinstance(value, float):
            yield f"{indent}{key:<{width}}  {value:.4g}"
        elif isinstance(value, (list, tuple)) and len(value) > 12:
            yield f"{indent}{key:<{width}}  {len(value)} entries (see --json)"
        else:
            yield f"{indent}{key:<{width}}  {value}"


class _TolerantPipe(io.FileIO):
    """A file descriptor that discards data written after the reader closed the pipe."""

    def write(self, data: Any, /) -> int | None:
        try:
            return super().write(data)
        except BrokenPipeError:
            return memoryview(data).nbytes


@contextlib.contextmanager
def tolerate_closed_pipes() -> Iterator[None]:
    """Ignores closed pipes behind stdout and stderr in this block, so that the command runs to its end.

    Streams that do not belong to the process, such as those of a test, are left unchanged.
    """
    original = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = wrapped = tuple(map(_tolerant, original))
    try:
        yield
    finally:
        for stream, original_stream in zip(wrapped, original, strict=True):
            if stream is not original_stream and not stream.closed:
                stream.flush()
        sys.stdout, sys.stderr = original


def _tolerant(stream: TextIO) -> TextIO:
    if not isinstance(stream, io.TextIOWrapper):
        return stream
    if stream.errors in ("strict", "surrogateescape"):
        # Characters that the terminal cannot encode are escaped instead of raising an error.
        stream.reconfigure(errors="backslashreplace")
    raw = getattr(stream.buffer, "raw", stream.buffer)  # `python -u` has no buffer
    if type(raw) is not io.FileIO:
        return stream
    stream.flush()
    return io.TextIOWrapper(
        io.BufferedWriter(_TolerantPipe(raw.fileno(), "w", closefd=False)),
        encoding=stream.encoding,
        errors=stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )
