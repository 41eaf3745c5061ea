"""Every command of every script, found through the parsers themselves; run by itself it walks them without extras.

python tests/command_walk.py CALLS.json    prints what each call said, as JSON
"""

import argparse
import contextlib
import importlib
import io
import json
import sys
from collections.abc import Iterator
from importlib.machinery import ModuleSpec, PathFinder
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.extras import EXTRAS

SCRIPTS = {
    entry.name: entry.value for entry in entry_points(group="console_scripts") if entry.name.startswith("copolicy-")
}


def parser_of(script: str) -> argparse.ArgumentParser:
    """The parser that a script hands to `commandline.run`; of `copolicy-train` that of its own commands."""
    module, _, function = SCRIPTS[script].partition(":")
    loaded: Any = importlib.import_module(module)
    if script == "copolicy-train":
        return importlib.import_module("copolicy.train.policy_commands").policy_parser()[0]
    caught: list[argparse.ArgumentParser] = []
    original = loaded.run
    loaded.run = lambda parser, argv=None: caught.append(parser) or 0
    try:
        getattr(loaded, function)([])
    finally:
        loaded.run = original
    return caught[0]


def leaves(parser: argparse.ArgumentParser, name: str) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Each command below a parser with its own parser, by what one types."""
    groups = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    if not groups:
        yield name, parser
    for group in groups:
        for word, below in group.choices.items():
            yield from leaves(below, f"{name} {word}")


def every_command() -> dict[str, argparse.ArgumentParser]:
    """All commands; `copolicy-train` alone, which has LeRobot's flags, is none of them."""
    return dict(leaf for script in sorted(SCRIPTS) for leaf in leaves(parser_of(script), script))


def call(words: list[str]) -> dict[str, Any]:
    """Status and output of a command in this process; 1 with the error where it ended with a traceback."""
    module, _, function = SCRIPTS[words[0]].partition(":")
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = getattr(importlib.import_module(module), function)(words[1:])
        except SystemExit as stop:
            status = stop.code or 0
        except Exception as error:
            status = 1
            err.write(f"Traceback: {type(error).__name__}: {error}")
    return {"words": words, "status": status, "out": out.getvalue(), "err": err.getvalue()}


class _WithoutExtras(PathFinder):
    """Finds no package of an extra. (None in `sys.modules` would do for imports, but scipy looks there for torch.)"""

    @classmethod
    def find_spec(cls, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        return None if fullname in EXTRAS else super().find_spec(fullname, path, target)


def _files() -> list[str]:
    return sorted(str(path) for path in Path().rglob("*"))


def main() -> None:
    """Hides every package of an extra, then makes the calls in turn; says which files each left behind."""
    sys.meta_path[:] = [_WithoutExtras if finder is PathFinder else finder for finder in sys.meta_path]
    if len(sys.argv) == 1:
        commands = [*SCRIPTS, *every_command()]
        calls = [[*command.split(), flag] for command in commands for flag in ("--help", "--version")]
        failed = [
            said for words in calls if words[-1] == "--help" or len(words) == 2 if (said := call(words))["status"]
        ]
        sys.exit("\n".join(map(str, failed)) or 0)
    said = []
    for words in json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")):
        before = _files()
        said.append(call(words))
        said[-1]["left"] = sorted(set(_files()) - set(before))
    print(json.dumps(said))


if __name__ == "__main__":
    main()
