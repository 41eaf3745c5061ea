"""What every command of every room shares: flags, exit status, progress, and errors of one line."""

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
from ..files.staging import causes, refusal
from .extras import extra_behind, require_packages

DISTRIBUTION = "lerobot_policy_copolicy"
"""The package as it is installed."""

Handler = Callable[[argparse.Namespace], dict]
"""A command: takes its parsed flags, returns its summary as a JSON-able dict."""

Needs = Sequence[str] | Callable[[argparse.Namespace], Sequence[str]]
"""Packages of extras that a command imports (see `extras`), or what says so of its parsed flags."""


def command_parser(prog: str, description: str) -> tuple[argparse.ArgumentParser, argparse._SubParsersAction]:
    """Parser of one room's script, and where its commands are added."""
    parser = argparse.ArgumentParser(prog=prog, description=description)
    add_version_flag(parser)
    return parser, parser.add_subparsers(dest="command", required=True, metavar="COMMAND")


def add_version_flag(parser: argparse.ArgumentParser) -> None:
    """The flag of every script that says which release it is of."""
    parser.add_argument("--version", action="version", version=f"%(prog)s {version(DISTRIBUTION)}")


def add_command(
    commands: argparse._SubParsersAction, name: str, handler: Handler, help: str, example: str, needs: Needs = ()
):
    """Adds a command with `--json`, `--debug` and an example at the end of its `--help`.

    Args:
        needs: checked before the handler is called, so that nothing is begun where a package is missing.
    """
    parser = commands.add_parser(
        name,
        help=help,
        description=help,
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_common_flags(parser)
    parser.set_defaults(handler=handler, needs=needs)
    return parser


def add_group(
    commands: argparse._SubParsersAction, name: str, help: str, description: str, examples: Sequence[str]
) -> argparse._SubParsersAction:
    """Adds a command of several steps, each to be added by `add_command` to what comes back."""
    parser = commands.add_parser(
        name,
        help=help,
        description=description,
        epilog="\n  ".join(("example:", *examples)),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    return parser.add_subparsers(dest="step", required=True, metavar="STEP")


def add_common_flags(parser: argparse.ArgumentParser) -> None:
    """The two flags that every command has."""
    parser.add_argument("--json", action="store_true", help="print one JSON object on stdout; logs go to stderr")
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")


def run(parser: argparse.ArgumentParser, argv: Sequence[str] | None = None) -> int:
    """Parses, runs the handler, prints its summary; returns the exit status (0, 1 or 2).

    A summary may hold `exit_status` when the work was done but its result is a finding (1). Whoever reads the output,
    such as `head`, may stop before its end: the work is done all the same, in silence.
    """
    with quiet_when_closed():
        logging.basicConfig(level=logging.INFO, stream=sys.stderr, format="%(message)s")
        try:
            arguments = parser.parse_args(argv)
        except CopolicyError as error:  # of a value that a flag does not take
            print(f"{parser.prog}: {error}", file=sys.stderr)
            return error.exit_status
        return _handled(parser.prog, arguments)


def _handled(prog: str, arguments: argparse.Namespace) -> int:
    try:
        needs: Needs = getattr(arguments, "needs", ())
        require_packages(*(needs(arguments) if callable(needs) else needs))
        try:
            summary = dict(arguments.handler(arguments))
        except ImportError as error:
            if missing := extra_behind(error):
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
    """What the system refused in one line with the path, None for an error of another kind.

    Libraries hide it behind errors of their own: h5py and pyarrow have an OSError without number and path, safetensors
    and torch none at all.
    """
    number = refusal(error)
    if number is None and not isinstance(error, OSError):
        return None
    texts = (error.strerror, " ".join(str(error).split())) if isinstance(error, OSError) else ()
    text = os.strerror(number) if number is not None else next(filter(None, texts), type(error).__name__)
    chain = causes(error) if number is not None else (error,)
    paths = (getattr(cause, "filename", None) for cause in chain)
    path = next((path for path in paths if isinstance(path, (str, bytes, os.PathLike))), None)
    return text if path is None else f"{os.fsdecode(path)}: {text}"


def progress[Item](items: Iterable[Item], total: int | None, what: str) -> Iterable[Item]:
    """Passes items on under a progress bar."""
    with progress_bar(total, what) as bar:
        for item in items:
            yield item
            bar.update()


def progress_bar(total: int | None, what: str) -> tqdm:
    """A progress bar on stderr when that is a terminal (or `COPOLICY_PROGRESS=1`), silent otherwise."""
    shown = sys.stderr.isatty() or os.environ.get("COPOLICY_PROGRESS") == "1"
    return tqdm(total=total, desc=what, disable=not shown, file=sys.stderr, mininterval=0.5)


def _lines(summary: dict, indent: str = "") -> Iterable[str]:
    width = max((len(str(key)) for key in summary), default=0)
    for key, value in summary.items():
        if isinstance(value, dict):
            yield f"{indent}{key}"
            yield from _lines(value, indent + "  ")
        elif isinstance(value, float):
            yield f"{indent}{key:<{width}}  {value:.4g}"
        elif isinstance(value, (list, tuple)) and len(value) > 12:
            yield f"{indent}{key:<{width}}  {len(value)} entries (see --json)"
        else:
            yield f"{indent}{key:<{width}}  {value}"


class _PipeEnd(io.FileIO):
    """A file descriptor that forgets what nobody reads any more."""

    def write(self, data: Any, /) -> int | None:
        try:
            return super().write(data)
        except BrokenPipeError:
            return memoryview(data).nbytes


@contextlib.contextmanager
def quiet_when_closed() -> Iterator[None]:
    """In this block a closed pipe behind stdout or stderr is no error: the command does its work to the end.

    Streams that are not those of the process, such as a test's, are left as they are.
    """
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = ours = tuple(map(_tolerant, before))
    try:
        yield
    finally:
        for stream, old in zip(ours, before, strict=True):
            if stream is not old and not stream.closed:
                stream.flush()
        sys.stdout, sys.stderr = before


def _tolerant(stream: TextIO) -> TextIO:
    if not isinstance(stream, io.TextIOWrapper):
        return stream
    if stream.errors in ("strict", "surrogateescape"):
        # A letter that the terminal's encoding lacks, or a file name of another one, is no reason to stop.
        stream.reconfigure(errors="backslashreplace")
    raw = getattr(stream.buffer, "raw", stream.buffer)  # without a buffer under `python -u`
    if type(raw) is not io.FileIO:
        return stream
    stream.flush()
    return io.TextIOWrapper(
        io.BufferedWriter(_PipeEnd(raw.fileno(), "w", closefd=False)),
        encoding=stream.encoding,
        errors=stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )
