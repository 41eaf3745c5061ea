"""`copolicy-eval plans`."""

import argparse
import math
from collections import Counter, defaultdict
from pathlib import Path
from typing import TYPE_CHECKING

from copolicy.collect.angular_limit import LIMIT, angular_limit_of
from copolicy.dataset.command_line.commands import add_command
from copolicy.dataset.command_line.flag_numbers import number, whole_number
from copolicy.dataset.command_line.maps_flag import add_maps_flag, map_set_name
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.staging import require_new

from ..study_flags import add_study_flags, learned_task, policy_of, protocol_of, study_needs

if TYPE_CHECKING:
    from .sampling import Decision

_MAPS = "unseen"


def add_plans_command(commands: argparse._SubParsersAction) -> None:
    """Adds `plans` to the commands of `copolicy-eval`."""
    command = add_command(
        commands,
        "plans",
        _plans,
        "many plans from one state: the ways that the policy sees there, as a picture and as counts",
        "copolicy-eval plans --policy pretrained --maps unseen --map 29 --samples 64 --out plans.png",
        study_needs,
    )
    command.add_argument("--policy", required=True, type=Path, help="checkpoint folder")
    add_maps_flag(command, _MAPS, use_default=False)
    command.add_argument(
        "--map",
        required=True,
        type=whole_number("--map", None),
        metavar="INDEX",
        help="which map of the set, from 0 on",
    )
    command.add_argument("--samples", type=whole_number("--samples", 1, 10_000), default=64, help="plans (default: 64)")
    command.add_argument(
        "--seconds",
        type=number("--seconds", 0, 3600),
        default=0.0,
        help="sample this long into an episode of the policy (default: 0)",
    )
    command.add_argument("--out", required=True, type=Path, help="where the picture goes, a PNG")
    add_study_flags(command, actions_per_plan=8)


def _plans(arguments: argparse.Namespace) -> dict:
    if arguments.out.suffix.lower() != ".png":
        raise InvalidValueError(str(arguments.out), "a name that ends with .png", arguments.out.suffix)
    require_new(arguments.out, overwrite=arguments.overwrite)
    task = learned_task(arguments.policy)
    chosen = task.scenario_set(map_set_name(task, arguments.maps, _MAPS))
    maps = chosen.scenarios
    if not 0 <= arguments.map < len(maps):
        raise InvalidValueError("--map", f"0 to {len(maps) - 1}", arguments.map)
    if not (math.isfinite(arguments.seconds) and arguments.seconds >= 0):
        raise InvalidValueError("--seconds", "a number of at least 0", arguments.seconds)
    # Deferred: `--help` and a wrong call should not wait for torch.
    from .figure import save_plans
    from .sampling import sample_plans

    policy = policy_of(arguments.policy, arguments)
    protocol = protocol_of(arguments, [(str(arguments.policy), policy.conditions)])
    decision = sample_plans(
        policy,
        maps[arguments.map],
        protocol.physics,
        samples=arguments.samples,
        seconds=arguments.seconds,
        fps=protocol.fps,
        seed=arguments.seed,
    )
    map_id = task.identify(decision.map_config)[0]
    seconds = (len(decision.way) - 1) / task.spec.record_hz
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    save_plans(
        decision,
        arguments.out,
        f"{len(decision.samples)} plans of one policy for both players from one state: "
        f"{task.words.scenario} {map_id}, {seconds:g} s after the start, in simulation",
    )
    return {
        "map": map_id,
        **({"map_set": chosen.describe()} if chosen.from_file else {}),
        "seconds": seconds,
        "samples": len(decision.samples),
        "fps": protocol.fps,
        **({LIMIT: limit} if (limit := angular_limit_of(protocol.physics)) is not None else {}),
        **({"told_otherwise": list(protocol.told_otherwise)} if protocol.told_otherwise else {}),
        **_counts(decision),
        "picture": str(arguments.out),
    }


def _counts(decision: "Decision") -> dict:
    """Of each route: how often, and the mean first force of each player. Of all: how the episodes ended."""
    groups: dict[str, list] = defaultdict(list)
    for sample in decision.samples:
        if sample.route is not None:
            groups[sample.route].append(sample.plan[0])
    routes = {}
    for word, first in sorted(groups.items()):
        mean = [round(float(sum(force) / len(first)), 3) for force in zip(*first, strict=True)]
        half = len(mean) // 2
        routes[word] = {"plans": len(first), "robot_first_force": mean[:half], "human_first_force": mean[half:]}
    reasons = Counter(sample.outcome.reason for sample in decision.samples)
    labelled = {"routes": routes}
    if not decision.task.offers("strategy"):
        labelled = {"succeeded": routes.get("", {"plans": 0}), "routes": decision.task.missing("strategy labels")}
    return {**labelled, "ended_by": dict(sorted(reasons.items()))}
