"""`copolicy-eval compare`."""

import argparse
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import Commands, add_command
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.staging import replace_text, require_new


def add_compare_command(commands: Commands) -> None:
    """Adds `compare` to the commands of `copolicy-eval`."""
    command = add_command(
        commands,
        "compare",
        _compare,
        "compare results of one study, paired by start: the first method with each of the others",
        "copolicy-eval compare codp_h.json codp.json\n"
        "  copolicy-eval compare --method CoDP-H h_seed0.json h_seed1.json --method CoDP c_seed0.json c_seed1.json\n"
        "  copolicy-eval compare --measurements trials.csv --unit participant --factors method configuration "
        "--measure success",
    )
    command.add_argument("files", nargs="*", type=Path, metavar="FILE", help="results, one method per file")
    command.add_argument(
        "--method",
        action="append",
        nargs="+",
        default=[],
        metavar=("NAME", "FILE"),
        help="name of a method and the results of its training runs; repeat for each method",
    )
    command.add_argument(
        "--measurements",
        type=Path,
        metavar="CSV",
        help="analyse a table of trials instead, one row each: repeated-measures ANOVA, rank tests, contrasts",
    )
    command.add_argument("--unit", help="its column of the unit of analysis (default: participant)")
    command.add_argument("--factors", nargs="+", metavar="COLUMN", help="its one or two within-unit factors")
    command.add_argument("--measure", help="its column of values, numbers or true and false (default: success)")
    command.add_argument("--out", type=Path, help="also write the Markdown table to this file")
    command.add_argument("--overwrite", action="store_true", help="replace an existing file")


def _compare(arguments: argparse.Namespace) -> dict[str, Any]:
    table_flags = {f"--{name}": getattr(arguments, name) for name in ("unit", "factors", "measure")}
    if arguments.measurements is not None:
        return _analyse(arguments)
    for flag, value in table_flags.items():
        if value is not None:
            raise InvalidValueError(flag, "--measurements too", value)
    # Imported here so that `--help` does not wait for scipy.
    from .compare import compare
    from .markdown import markdown
    from .results import read_methods

    files = _methods(arguments)
    if arguments.out:
        require_new(arguments.out, overwrite=arguments.overwrite)
    comparison = compare(read_methods(files))
    text = markdown(comparison)
    if arguments.out:
        replace_text(arguments.out, text)
    if arguments.json:
        return {**comparison, "markdown": text}
    print(text, end="")
    return {}


def _analyse(arguments: argparse.Namespace) -> dict[str, Any]:
    if arguments.files or arguments.method:
        raise InvalidValueError("--measurements", "no results beside it", [str(path) for path in arguments.files])
    if not arguments.factors or len(arguments.factors) > 2 or len(set(arguments.factors)) < len(arguments.factors):
        raise InvalidValueError("--factors", "one or two different columns of --measurements", arguments.factors)
    if arguments.out:
        require_new(arguments.out, overwrite=arguments.overwrite)
    # Imported here so that `--help` and argument errors do not wait for scipy.
    from ..within_subject.analysis import analyse, markdown
    from ..within_subject.measurements import Measurements

    unit, measure = arguments.unit or "participant", arguments.measure or "success"
    analysis = analyse(Measurements.read(arguments.measurements, measure, unit, arguments.factors))
    text = markdown(analysis)
    if arguments.out:
        replace_text(arguments.out, text)
    if arguments.json:
        return {**analysis, "markdown": text}
    print(text, end="")
    return {}


def _methods(arguments: argparse.Namespace) -> dict[str, list[Path]]:
    """Files by method name, in the order of the arguments: positional files first, then `--method`."""
    files: list[Path] = arguments.files
    depth = next(
        (depth for depth in range(1, 9) if len({path.parts[-depth:] for path in files}) == len(files)), len(files)
    )
    methods = [("/".join(path.with_suffix("").parts[-depth:]), [path]) for path in files]
    for name, *paths in arguments.method:
        if not paths:
            raise InvalidValueError("--method", "a name and at least one file", [name])
        methods.append((name, [Path(path) for path in paths]))
    if len(methods) < 2:
        raise InvalidValueError("FILE", "at least two files or methods to compare", len(methods))
    names = [name for name, _ in methods]
    if len(set(names)) < len(names):
        raise InvalidValueError("FILE", "methods of different names, each file once", names)
    return dict(methods)
