"""`copolicy-train export` and `copolicy-train pretrained`: write a policy for publication, locate the packaged one."""

import argparse
from pathlib import Path
from typing import Any

from copolicy.collect.agents.checkpoint_folder import pretrained_folder
from copolicy.dataset.command_line.commands import add_command, command_parser
from copolicy.dataset.command_line.extras import POLICIES
from copolicy.dataset.exceptions import FileFormatError


def policy_parser() -> tuple[argparse.ArgumentParser, set[str]]:
    """The parser of these commands and their names; other arguments are for LeRobot's trainer."""
    parser, commands = command_parser("copolicy-train", "Export a trained policy; locate the one in the package.")
    export = add_command(
        commands,
        "export",
        _export,
        "write a checkpoint's averaged weights for publication, checked to predict the same actions",
        "copolicy-train export outputs/training --out outputs/model --eval outputs/eval/holdout.json",
        POLICIES,
    )
    export.add_argument("checkpoint", help="checkpoint folder, or the folder of a run (its last checkpoint)")
    export.add_argument("--out", type=Path, required=True, help="folder to write")
    export.add_argument(
        "--eval", action="append", type=Path, default=[], metavar="FILE", help="result of copolicy-eval to include"
    )
    export.add_argument(
        "--commands", type=Path, metavar="FILE", help="text file of the commands that made the policy, one per line"
    )
    export.add_argument("--overwrite", action="store_true", help="replace the policy at --out, with its card")
    add_command(
        commands,
        "pretrained",
        _pretrained,
        "print the path of the model that comes with the package, for --policy.path of LeRobot's commands",
        "lerobot-eval --env.type=table_carrying \\\n"
        "      --policy.path=\"$(copolicy-train pretrained | sed -n 's/^path *//p')\"",
    )
    return parser, set(commands.choices)


def _export(arguments: argparse.Namespace) -> dict[str, Any]:
    from .export import export_checkpoint

    commands = []
    if arguments.commands is not None:
        try:
            text = arguments.commands.read_text(encoding="utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            raise FileFormatError(arguments.commands, "a text of commands", type(error).__name__) from None
        commands = [line.strip() for line in text.replace("\\\n", " ").splitlines()]
    return export_checkpoint(
        arguments.checkpoint,
        arguments.out,
        arguments.eval,
        [" ".join(line.split()) for line in commands if line and not line.startswith("#")],
        arguments.overwrite,
    )


def _pretrained(_: argparse.Namespace) -> dict[str, Any]:
    folder = pretrained_folder()
    return {"path": str(folder), "bytes": sum(file.stat().st_size for file in folder.iterdir())}
