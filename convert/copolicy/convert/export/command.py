"""The command `copolicy-convert export`."""

import argparse
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import Commands, add_command
from copolicy.dataset.command_line.flag_numbers import number, seed
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.staging import require_new

FORMATS = {
    "zarr": "diffusion_policy's ReplayBuffer, with the arrays of the original program",
    "robomimic": "one HDF5 file",
    "minari": "a folder NAME-vN",
}

_WRITERS = {"zarr": "numcodecs", "robomimic": "h5py", "minari": "h5py"}


def add_export_command(commands: Commands) -> None:
    """Adds `export`."""
    parser = add_command(
        commands, "export", _export, "write a LeRobot data set of this project in another project's format",
        "copolicy-convert export datasets/table --format zarr --out exports/table.zarr",
        lambda arguments: (_WRITERS[arguments.format],),
    )  # fmt: skip
    parser.add_argument("root", type=Path, metavar="PATH", help="folder of a LeRobot data set")
    formats = "; ".join(f"{name}: {description}" for name, description in FORMATS.items())
    parser.add_argument("--format", choices=tuple(FORMATS), required=True, help=formats)
    parser.add_argument("--out", type=Path, required=True, metavar="OUT", help="the export; must not exist")
    parser.add_argument(
        "--alignment", choices=("ours", "upstream"), default=None,
        help="zarr only: the action of a row was taken in its state (ours, the default), or led to its state "
        "(upstream, as in the store of the original program)",
    )  # fmt: skip
    parser.add_argument(
        "--valid", type=number("--valid", 0), metavar="PROPORTION",
        help="robomimic only: proportion of episodes in the filter key `valid`, the others are `train` (default: the "
        "splits of the data set, which copolicy-dataset split --as-splits writes)",
    )  # fmt: skip
    parser.add_argument(
        "--valid-by", choices=("pairs", "maps", "episodes"),
        help="with --valid: what is never divided between both, as in copolicy-dataset split (default: pairs)",
    )  # fmt: skip
    parser.add_argument("--seed", type=seed(), help="with --valid: seed of the random selection (default: 0)")
    parser.add_argument(
        "--keep-discarded", action="store_true", help="also export discarded and excluded episodes, with their flags"
    )


def _export(arguments: argparse.Namespace) -> dict[str, Any]:
    if arguments.alignment and arguments.format != "zarr":
        raise InvalidValueError("--alignment", "--format zarr beside it", arguments.format)
    for flag, value in (("--valid", arguments.valid), ("--valid-by", arguments.valid_by), ("--seed", arguments.seed)):
        if value is not None and (arguments.format != "robomimic" or arguments.valid is None):
            raise InvalidValueError(flag, "--format robomimic and --valid beside it", value)
    if arguments.seed is not None and arguments.seed < 0:
        raise InvalidValueError("--seed", "at least 0", arguments.seed)
    require_new(arguments.out)

    from .source import ExportSource

    source = ExportSource.open(arguments.root, arguments.keep_discarded)
    if arguments.format == "zarr":
        from .replay_buffer import export_replay_buffer

        written = export_replay_buffer(source, arguments.out, arguments.alignment or "ours")
    elif arguments.format == "robomimic":
        from .robomimic import Validation, export_robomimic

        options = arguments.valid, arguments.valid_by or "pairs", arguments.seed or 0
        validation = None if arguments.valid is None else Validation(*options)
        written = export_robomimic(source, arguments.out, validation)
    else:
        from .minari import export_minari

        written = export_minari(source, arguments.out)
    return {
        "out": str(arguments.out),
        "format": arguments.format,
        "episodes": len(source.rows),
        "discarded_left_out": source.left_out,
        "sources": source.facts()["sources"],
        "physics": source.facts()["physics"],
        **written,
    }
