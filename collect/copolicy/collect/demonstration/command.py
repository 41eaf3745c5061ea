"""The flags of `copolicy-collect demo`."""

import argparse
import itertools
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import add_command, progress
from copolicy.dataset.command_line.extras import POLICIES
from copolicy.dataset.command_line.flag_numbers import number, seed, whole_number
from copolicy.dataset.command_line.maps_flag import add_maps_flag, add_task_flag, set_name
from copolicy.dataset.exceptions import InvalidValueError, OutputExistsError
from copolicy.dataset.task import get_task

from ..agents.checkpoint_folder import PRETRAINED


def add_demo_command(commands: argparse._SubParsersAction) -> None:
    """Adds `demo` to the commands of `copolicy-collect`."""
    command = add_command(
        commands,
        "demo",
        _demo,
        help="film a policy that carries the table with a simulated partner, as a GIF",
        example="copolicy-collect demo --out outputs/demo.gif --map 40 52",
        needs=(*POLICIES, "PIL"),
    )
    command.add_argument("--out", type=Path, required=True, metavar="OUT.gif", help="the GIF to write")
    command.add_argument(
        "--policy", default=PRETRAINED, help="checkpoint folder (default: pretrained, the model of the package)"
    )
    add_task_flag(command)
    add_maps_flag(command, "unseen", given=False)
    command.add_argument(
        "--map",
        type=whole_number("--map", None),
        nargs="+",
        default=[0],
        metavar="N",
        help="numbers of maps, one episode each (default 0)",
    )
    command.add_argument("--partner", metavar="PAIR", help="simulated pair of the task (default: its first one)")
    command.add_argument("--seed", type=seed(), default=0, help="of plans and partner (default 0)")
    command.add_argument("--speed", type=number("--speed", 0), default=2.0, help="times real time (default 2)")
    command.add_argument("--fps", type=whole_number("--fps", None), default=12, help="pictures a second (default 12)")
    command.add_argument("--width", type=whole_number("--width", None), default=600, help="px (default 600)")
    command.add_argument("--overwrite", action="store_true", help="replace the film")


def _demo(arguments: argparse.Namespace) -> dict[str, Any]:
    task, path = get_task(arguments.task), arguments.out
    chosen = task.scenario_set(set_name(task, arguments.maps, "unseen"))
    maps = chosen.scenarios
    for name, value, least, most in (
        ("seed", arguments.seed, 0, 2**32 - 1),
        ("fps", arguments.fps, 1, 50),
        ("width", arguments.width, 200, 2000),
        ("speed", arguments.speed, 0.1, 20),
        *(("map", place, 0, len(maps) - 1) for place in arguments.map),
    ):
        if not least <= value <= most:
            raise InvalidValueError(f"--{name}", f"{least} to {most}", value)
    if path.suffix.lower() != ".gif":
        raise InvalidValueError("--out", "a name that ends with .gif", str(path))
    if path.exists() and not arguments.overwrite:
        raise OutputExistsError(path)
    # Loading torch and pygame takes a moment that `--help` should not.
    from ..agents import load_policy
    from ..agents.simulated import pair_name
    from ..replay.frames import frame_count
    from ..replay.video import save_gif
    from .film import SIZE, demonstrate, pictures

    task.required_outline  # noqa: B018 (a film needs one)
    partner = pair_name(task, arguments.partner)
    policy = load_policy(arguments.policy)
    physics = policy.conditions.physics
    tracks = [demonstrate(policy, maps[place], partner, arguments.seed, physics, task) for place in arguments.map]
    size = (arguments.width // 2 * 2, round(arguments.width * SIZE[1] / SIZE[0] / 2) * 2)
    film = (size, arguments.fps, arguments.speed)
    frames = itertools.chain.from_iterable(pictures(track, *film) for track in tracks)
    count = sum(frame_count(track, arguments.fps, arguments.speed) for track in tracks)
    if arguments.overwrite:
        path.unlink(missing_ok=True)
    save_gif(progress(frames, count, "pictures"), path, size, arguments.fps, colours=64)
    return {
        "out": str(path),
        "bytes": path.stat().st_size,
        "pictures": count,
        "policy": policy.name,
        "learned": policy.conditions.to_json(),
        "partner": f"simulated, human of {partner}",
        "episodes": [
            f"{chosen.label} {place}: {track.episode.meta.termination_reason} after {track.seconds:.1f} s"
            for place, track in zip(arguments.map, tracks, strict=True)
        ],
    }
