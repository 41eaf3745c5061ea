"""`copolicy-eval plans`."""

import argparse
import math
from collections import Counter, defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from copolicy.collect.angular_limit import LIMIT_SETTING, angular_limit_of
from copolicy.dataset.command_line.commands import Commands, add_command
from copolicy.dataset.command_line.flag_numbers import number, whole_number
from copolicy.dataset.command_line.maps_flag import add_maps_flag, map_set_name
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.staging import require_new

from ..study_flags import POLICY_HELP, add_study_flags, checkpoint_task, study_needs, study_policy, study_protocol

if TYPE_CHECKING:
    from .sampling import BranchPoint

_DEFAULT_MAPS = "unseen"


def add_plans_command(commands: Commands) -> None:
    """Adds `plans` to the commands of `copolicy-eval`."""
    command = add_command(
        commands,
        "plans",
        _plans,
        "sample many action chunks in one state; count and draw the routes that they lead to",
        "copolicy-eval plans --policy pretrained --maps unseen --map 29 --samples 64 --out plans.png",
        study_needs,
    )
    command.add_argument("--policy", required=True, type=Path, help=POLICY_HELP)
    add_maps_flag(command, _DEFAULT_MAPS, use_default=False)
    command.add_argument(
        "--map",
        required=True,
        nargs="+",
        type=whole_number("--map", None),
        metavar="INDEX",
        help="index of the map in the set, from 0; several maps become the rows of one sheet",
    )
    samples = whole_number("--samples", 1, 10_000)
    command.add_argument("--samples", type=samples, default=64, help="number of action chunks (default: 64)")
    command.add_argument(
        "--seconds",
        type=number("--seconds", 0, 3600),
        default=0.0,
        help="time of the state in an episode of the policy, s (default: 0)",
    )
    command.add_argument("--out", required=True, type=Path, help="figure to write, a PNG; an SVG is written beside it")
    add_study_flags(command, n_action_steps=8)


def _plans(arguments: argparse.Namespace) -> dict[str, Any]:
    if arguments.out.suffix.lower() != ".png":
        raise InvalidValueError(str(arguments.out), "a name that ends with .png", arguments.out.suffix)
    svg = arguments.out.with_suffix(".svg")
    require_new(arguments.out, svg, overwrite=arguments.overwrite)
    task = checkpoint_task(arguments.policy)
    chosen = task.scenario_set(map_set_name(task, arguments.maps, _DEFAULT_MAPS))
    scenarios = chosen.scenarios
    for index in arguments.map:
        if not 0 <= index < len(scenarios):
            raise InvalidValueError("--map", f"0 to {len(scenarios) - 1}", index)
    if not (math.isfinite(arguments.seconds) and arguments.seconds >= 0):
        raise InvalidValueError("--seconds", "a number of at least 0", arguments.seconds)
    # Imported here so that `--help` and argument errors do not wait for torch.
    from .figure import save_chunk_figure
    from .sampling import sample_chunks

    policy = study_policy(arguments.policy, arguments)
    if policy.chunk_size < 2:
        raise InvalidValueError("--policy", "a policy of action chunks", f"{policy.name}, which acts frame by frame")
    protocol = study_protocol(arguments, [(str(arguments.policy), policy.conditions)])
    branch_points = [
        sample_chunks(
            policy,
            scenario,
            protocol.settings,
            samples=arguments.samples,
            seconds=arguments.seconds,
            fps=protocol.fps,
            seed=arguments.seed,
        )
        for scenario in {scenarios[index].digest: scenarios[index] for index in arguments.map}.values()  # each once
    ]
    names = [task.identify(branch_point.scenario)[0] for branch_point in branch_points]
    seconds = (len(branch_points[0].approach) - 1) / task.spec.record_hz
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    many = f" of each of {len(names)} {task.words.scenarios}"
    of_maps = f": {task.words.scenario} {names[0]}" if len(names) == 1 else many
    save_chunk_figure(
        branch_points,
        [arguments.out, svg],
        f"{arguments.samples} action chunks of one policy for both players, sampled in one state"
        f"{of_maps}, {seconds:g} s after the start, in simulation",
    )
    counts = {name: _counts(branch_point) for name, branch_point in zip(names, branch_points, strict=True)}
    return {
        **({"map": names[0]} if len(names) == 1 else {}),
        **({"map_set": chosen.describe()} if chosen.from_file else {}),
        "seconds": seconds,
        "samples": arguments.samples,
        "fps": protocol.fps,
        **({LIMIT_SETTING: limit} if (limit := angular_limit_of(protocol.settings)) is not None else {}),
        **({"told_otherwise": list(protocol.contradictions)} if protocol.contradictions else {}),
        **(counts[names[0]] if len(names) == 1 else {"maps": counts}),
        "figure": str(arguments.out),
        "svg": str(svg),
    }


def _counts(branch_point: "BranchPoint") -> dict[str, Any]:
    """Counts chunks and averages the players' first forces by route; counts how the episodes ended."""
    groups: dict[str, list] = defaultdict(list)
    for sample in branch_point.samples:
        if sample.route is not None:
            groups[sample.route].append(sample.chunk[0])
    routes = {}
    for route, first in sorted(groups.items()):
        mean = [round(float(sum(force) / len(first)), 3) for force in zip(*first, strict=True)]
        half = len(mean) // 2
        routes[route] = {"plans": len(first), "robot_first_force": mean[:half], "human_first_force": mean[half:]}
    reasons = Counter(sample.episode.reason for sample in branch_point.samples)
    by_route = {"routes": routes}
    if not branch_point.task.offers("strategy"):
        by_route = {"succeeded": routes.get("", {"plans": 0}), "routes": branch_point.task.missing("strategy labels")}
    return {**by_route, "ended_by": dict(sorted(reasons.items()))}
