"""Every command that takes a path of recordings or files, driven as a user would, and what became of the call."""

import contextlib
import io
import warnings
from collections.abc import Callable
from pathlib import Path

from copolicy.cards.cli import main as cards
from copolicy.collect.cli import main as collect
from copolicy.convert.cli import main as convert
from copolicy.dataset.cli import main as dataset
from copolicy.evaluate.cli import main as evaluate

Main = Callable[[list[str]], int]


def _out(scratch: Path) -> list[str]:
    return ["--out", str(scratch / "out"), "--repo-id", "lab/x"]


COMMANDS: dict[str, Callable[[Path, Path], tuple[Main, list[str]]]] = {
    "collect replay": lambda path, scratch: (collect, ["replay", str(path), "--verify"]),
    "collect recover": lambda path, scratch: (collect, ["recover", str(path)]),
    "collect play": lambda path, scratch: (
        collect,
        ["play", "--out", str(scratch / "play"), "--pair", "P01", "--episodes", "1", "--headless", "--players",
         f"replay:{path}", "scripted"],
    ),
    "convert mcap": lambda path, scratch: (convert, ["mcap", str(path), *_out(scratch)]),
    "convert upstream": lambda path, scratch: (convert, ["upstream", str(path), *_out(scratch)]),
    "convert merge": lambda path, scratch: (
        convert, ["merge", str(path), str(path), *_out(scratch)],
    ),
    "convert export": lambda path, scratch: (
        convert, ["export", str(path), "--format", "zarr", "--out", str(scratch / "x.zarr")],
    ),
    "dataset check": lambda path, scratch: (dataset, ["check", str(path)]),
    "dataset stats": lambda path, scratch: (dataset, ["stats", str(path)]),
    "cards dataset": lambda path, scratch: (cards, ["dataset", str(path)]),
    "eval human summarise": lambda path, scratch: (evaluate, ["human", "summarise", str(path)]),
    "eval human run": lambda path, scratch: (
        evaluate, ["human", "run", str(path), "--participant", "P01", "--out", str(scratch / "sessions")],
    ),
}  # fmt: skip


def call(main: Main, arguments: list[str]) -> tuple[str, str]:
    """What became of a call: `refused`, `passed` (exit status 0), or what is wrong with it, and what it said."""
    out, err = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
            warnings.simplefilter("error")
            status = main(arguments)
    except SystemExit as error:
        return f"PARSER {error.code}", err.getvalue()
    except Exception as error:
        return f"TRACEBACK {type(error).__name__}", str(error)
    lines = err.getvalue().splitlines()
    if status == 0:
        return "passed", out.getvalue()
    # A check or a recovery prints its findings and nothing on stderr.
    if status in (1, 2) and (len(lines) == 1 or (not lines and out.getvalue())):
        return "refused", "\n".join(lines) or out.getvalue()
    return f"{len(lines)} LINES, exit {status}", err.getvalue()
