"""`copolicy-eval`: the paper's studies, replayed on a checkpoint."""

import argparse
import json
import math
import os
from collections.abc import Sequence
from pathlib import Path

from copolicy.dataset.commandline import add_command, command_parser, progress_bar, run
from copolicy.dataset.exceptions import InvalidValueError, OutputExistsError
from copolicy.dataset.task import MAP_SETS, Physics, map_set

ANGULAR_LIMITS = {"pi/2": math.pi / 2, "pi/8": math.pi / 8}


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `copolicy-eval`."""
    parser, commands = command_parser("copolicy-eval", "Judge a co-policy as the paper does.")
    coplan = add_command(
        commands,
        "coplan",
        _coplan,
        "both players act on one sampled plan, on all maps of a set",
        "copolicy-eval coplan --policy outputs/run/checkpoints/last/pretrained_model --maps holdout --out eval.json",
    )
    coplan.add_argument("--policy", required=True, type=Path, help="checkpoint folder")
    coplan.add_argument("--maps", default="holdout", choices=sorted(MAP_SETS), help="map set (default: holdout)")
    coplan.add_argument("--orientations", action="store_true", help="each map with four start orientations")
    coplan.add_argument("--repeats", type=int, default=1, help="episodes a map (default: 1)")
    coplan.add_argument("--limit", type=int, help="only the first N maps, for a quick look; stated in the result")
    coplan.add_argument("--out", required=True, type=Path, help="where eval.json goes; the picture stands beside it")
    coplan.add_argument("--actions-per-plan", type=int, default=8, help="executed before replanning (default: 8)")
    coplan.add_argument("--fps", type=int, default=10, help="rate of the training data (default: 10, a hold of three)")
    coplan.add_argument("--step-limit", type=int, default=2000, help="30 Hz steps until a time-out (default: 2000)")
    coplan.add_argument("--angular-limit", choices=ANGULAR_LIMITS, default="pi/2", help="default: pi/2")
    coplan.add_argument("--num-inference-steps", type=int, help="denoising steps (default: the checkpoint's)")
    coplan.add_argument(
        "--initial-noise-scale", type=float, help="scale of the first noise (default: the checkpoint's)"
    )
    coplan.add_argument("--seed", type=int, default=0, help="seed of the sampled noise (default: 0)")
    coplan.add_argument("--device", default="cpu", help="default: cpu")
    coplan.add_argument("--overwrite", action="store_true", help="replace an existing result")
    return run(parser, argv)


def _coplan(arguments: argparse.Namespace) -> dict:
    picture = arguments.out.with_suffix(".png")
    for path in (arguments.out, picture):
        if path.exists() and not arguments.overwrite:
            raise OutputExistsError(path)
    for name in ("repeats", "actions_per_plan", "limit"):
        if getattr(arguments, name) is not None and getattr(arguments, name) < 1:
            raise InvalidValueError(f"--{name.replace('_', '-')}", "at least 1", getattr(arguments, name))
    # Deferred: `--help` and a wrong call should not wait for torch.
    from .coplan import coplan
    from .planner import Planner
    from .study import summarise
    from .trajectories_figure import save_trajectories

    changed = {
        name: getattr(arguments, name)
        for name in ("num_inference_steps", "initial_noise_scale")
        if getattr(arguments, name) is not None
    }
    planner = Planner(arguments.policy, arguments.device, **changed)
    available = planner.checkpoint.planned_frames
    if arguments.actions_per_plan > available:
        raise InvalidValueError("--actions-per-plan", f"at most the plan's {available}", arguments.actions_per_plan)
    maps = map_set(arguments.maps, arguments.orientations)[: arguments.limit]
    physics = Physics(ANGULAR_LIMITS[arguments.angular_limit], arguments.step_limit)
    with progress_bar(len(maps) * arguments.repeats, "episodes") as bar:
        outcomes = coplan(
            planner,
            maps,
            physics,
            repeats=arguments.repeats,
            actions_per_plan=arguments.actions_per_plan,
            fps=arguments.fps,
            seed=arguments.seed,
            on_plan=lambda finished: bar.update(finished - bar.n),
        )
    summary = summarise(outcomes, planner)
    result = {
        "study": "coplan",
        "label": "co-planning in simulation: both players act on one sampled plan, no person took part",
        "policy": planner.describe(),
        "settings": {
            "maps": arguments.maps,
            "orientations": arguments.orientations,
            "map_count": len(maps),
            "complete_set": arguments.limit is None,
            "repeats": arguments.repeats,
            "actions_per_plan": arguments.actions_per_plan,
            "fps": arguments.fps,
            "hold": 30 // arguments.fps,
            "step_limit": arguments.step_limit,
            "angular_acceleration_limit": physics.angular_acceleration_limit,
            "seed": arguments.seed,
            "device": arguments.device,
        },
        "summary": summary,
        "episodes": [outcome.to_json() for outcome in outcomes],
    }
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    success = summary["success"]
    percent = f"{100 * success['mean']:.1f} ± {100 * success['standard_error']:.1f} %"
    save_trajectories(
        outcomes, picture, f"co-planning on {arguments.maps}: {percent} of {success['episodes']} episodes"
    )
    # Written last and renamed, so that a result is there whole or not at all.
    partial = arguments.out.with_name(arguments.out.name + ".part")
    partial.write_text(json.dumps(result, indent=1) + "\n")
    os.replace(partial, arguments.out)
    return {
        "success": percent,
        "episodes": success["episodes"],
        "ended_by": summary["ended_by"],
        "time_to_completion_s": summary["time_to_completion_s"]["mean"],
        "interaction_force": summary["interaction_force"]["mean"],
        "planning_ms_per_call": summary["planning_ms_per_call"]["p50"],
        "result": str(arguments.out),
        "picture": str(picture),
    }
