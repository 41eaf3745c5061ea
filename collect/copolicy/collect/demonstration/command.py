"""The command `copolicy-collect demo`."""

import argparse
import itertools
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import Commands, add_command, progress
from copolicy.dataset.command_line.extras import POLICIES
from copolicy.dataset.command_line.flag_numbers import number, seed, whole_number
from copolicy.dataset.command_line.maps_flag import add_maps_flag, add_task_flag, map_set_name
from copolicy.dataset.exceptions import InvalidValueError, OutputExistsError
from copolicy.dataset.task import get_task

from ..agents.checkpoint_folder import PRETRAINED


def add_demo_command(commands: Commands) -> None:
    """Adds `demo` to the commands of `copolicy-collect`."""
    command = add_command(
        commands,
        "demo",
        _demo,
        help="write a GIF of a policy that carries the table with a simulated partner",
        example="copolicy-collect demo --out outputs/demo.gif --map 40 52",
        needs=(*POLICIES, "PIL"),
    )
    command.add_argument("--out", type=Path, required=True, metavar="OUT.gif", help="the GIF to write")
    command.add_argument(
        "--policy", default=PRETRAINED, help="checkpoint folder (default: pretrained, the model of the package)"
    )
    add_task_flag(command)
    add_maps_flag(command, "unseen", use_default=False)
    command.add_argument(
        "--map",
        type=whole_number("--map", None),
        nargs="+",
        default=[0],
        metavar="N",
        help="numbers of maps, one episode each (default 0)",
    )
    command.add_argument("--partner", metavar="PAIR", help="simulated pair of the task (default: its first one)")
    command.add_argument("--seed", type=seed(), default=0, help="seed of the policy and the partner (default 0)")
    command.add_argument("--speed", type=number("--speed", 0), default=2.0, help="times real time (default 2)")
    command.add_argument("--fps", type=whole_number("--fps", None), default=12, help="frames per second (default 12)")
    command.add_argument("--width", type=whole_number("--width", None), default=600, help="px (default 600)")
    command.add_argument("--overwrite", action="store_true", help="replace an existing file")


def _demo(arguments: argparse.Namespace) -> dict[str, Any]:
    task, path = get_task(arguments.task), arguments.out
    scenario_set = task.scenario_set(map_set_name(task, arguments.maps, "unseen"))
    scenarios = scenario_set.scenarios
    for name, value, minimum, maximum in (
        ("seed", arguments.seed, 0, 2**32 - 1),
        ("fps", arguments.fps, 1, 50),
        ("width", arguments.width, 200, 2000),
        ("speed", arguments.speed, 0.1, 20),
        *(("map", index, 0, len(scenarios) - 1) for index in arguments.map),
    ):
        if not minimum <= value <= maximum:
            raise InvalidValueError(f"--{name}", f"{minimum} to {maximum}", value)
    if path.suffix.lower() != ".gif":
        raise InvalidValueError("--out", "a name that ends with .gif", str(path))
    if path.exists() and not arguments.overwrite:
        raise OutputExistsError(path)
    # Imports of torch and pygame are slow, and `--help` does not need them.
    from ..agents import load_policy
    from ..agents.simulated_players import pair_name
    from ..replay.frames import frame_count
    from ..replay.video import save_gif
    from .video import SIZE, demonstrate, draw_images

    task.required_outline  # noqa: B018 (raises without one)
    partner = pair_name(task, arguments.partner)
    policy = load_policy(arguments.policy)
    settings = policy.conditions.settings
    tracks = [demonstrate(policy, scenarios[index], partner, arguments.seed, settings, task) for index in arguments.map]
    size = (arguments.width // 2 * 2, round(arguments.width * SIZE[1] / SIZE[0] / 2) * 2)
    images = itertools.chain.from_iterable(draw_images(track, size, arguments.fps, arguments.speed) for track in tracks)
    count = sum(frame_count(track, arguments.fps, arguments.speed) for track in tracks)
    if arguments.overwrite:
        path.unlink(missing_ok=True)
    save_gif(progress(images, count, "images"), path, size, arguments.fps, colours=64)
    return {
        "out": str(path),
        "bytes": path.stat().st_size,
        "frames": count,
        "policy": policy.name,
        "learned": policy.conditions.to_json(),
        "partner": f"simulated, human of {partner}",
        "episodes": [
            f"{scenario_set.label} {index}: {track.episode.meta.termination_reason} after {track.seconds:.1f} s"
            for index, track in zip(arguments.map, tracks, strict=True)
        ],
    }
