"""`copolicy-eval compare`."""

import argparse
from pathlib import Path

from copolicy.dataset.command_line.commands import add_command
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.staging import replace_text, require_new


def add_compare_command(commands: argparse._SubParsersAction) -> None:
    """Adds `compare` to the commands of `copolicy-eval`."""
    command = add_command(
        commands,
        "compare",
        _compare,
        "results of the same study on the same starts, paired: the first method against each other",
        "copolicy-eval compare codp_h.json codp.json\n"
        "  copolicy-eval compare --method CoDP-H h_seed0.json h_seed1.json --method CoDP c_seed0.json c_seed1.json",
    )
    command.add_argument("files", nargs="*", type=Path, metavar="FILE", help="results, each a method of its own")
    command.add_argument(
        "--method",
        action="append",
        nargs="+",
        default=[],
        metavar=("NAME", "FILE"),
        help="a method and the results of its trainings with different seeds; once for each method",
    )
    command.add_argument("--out", type=Path, help="also write the Markdown table into a file")
    command.add_argument("--overwrite", action="store_true", help="replace an existing file")


def _compare(arguments: argparse.Namespace) -> dict:
    # Deferred: `--help` should not wait for scipy.
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


def _methods(arguments: argparse.Namespace) -> dict[str, list[Path]]:
    """Names and files in the order in which they were given: files first, then `--method`."""
    files: list[Path] = arguments.files
    depth = next(
        (depth for depth in range(1, 9) if len({path.parts[-depth:] for path in files}) == len(files)), len(files)
    )
    named = [("/".join(path.with_suffix("").parts[-depth:]), [path]) for path in files]
    for name, *paths in arguments.method:
        if not paths:
            raise InvalidValueError("--method", "a name and at least one file", [name])
        named.append((name, [Path(path) for path in paths]))
    if len(named) < 2:
        raise InvalidValueError("FILE", "at least two files or methods to compare", len(named))
    names = [name for name, _ in named]
    if len(set(names)) < len(names):
        raise InvalidValueError("FILE", "methods of different names, each file once", names)
    return dict(named)
