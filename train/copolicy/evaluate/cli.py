"""`copolicy-eval`: the paper's studies, replayed on a checkpoint."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from copolicy.dataset.command_line.commands import add_command, command_parser, progress_bar, run
from copolicy.dataset.command_line.flag_numbers import add_whole_number
from copolicy.dataset.command_line.maps_flag import add_maps_flag, map_set_name
from copolicy.dataset.files.staging import require_new

from .comparison import add_compare_command
from .human_study import add_human_command
from .partner_study import add_partner_command
from .plans.command import add_plans_command
from .result_file import write_json
from .study_flags import add_study_flags, learned_task, policy_of, protocol_of, study_needs, study_settings

_MAPS = "holdout"


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `copolicy-eval`."""
    parser, commands = command_parser("copolicy-eval", "Judge a co-policy as the paper does.")
    coplan = add_command(
        commands,
        "coplan",
        _coplan,
        "both players act on one sampled plan, on all maps of a set",
        "copolicy-eval coplan --policy outputs/run/checkpoints/last/pretrained_model --maps holdout --out eval.json",
        study_needs,
    )
    coplan.add_argument("--policy", required=True, type=Path, help="checkpoint folder")
    add_maps_flag(coplan, _MAPS, use_default=False)
    coplan.add_argument("--orientations", action="store_true", help="each map with four start orientations")
    add_whole_number(coplan, "--repeats", "episodes a map (default: 1)", 1, 1, 10_000)
    add_whole_number(coplan, "--limit", "only the first N maps, for a quick look; stated in the result")
    coplan.add_argument("--out", required=True, type=Path, help="where eval.json goes; the picture stands beside it")
    add_study_flags(coplan, actions_per_plan=8)
    add_partner_command(commands)
    add_human_command(commands)
    add_compare_command(commands)
    add_plans_command(commands)
    return run(parser, argv)


def _coplan(arguments: argparse.Namespace) -> dict:
    picture = arguments.out.with_suffix(".png")
    require_new(arguments.out, picture, overwrite=arguments.overwrite)
    task = learned_task(arguments.policy)
    chosen = task.scenario_set(map_set_name(task, arguments.maps, _MAPS))
    if arguments.orientations:
        chosen = task.turned(chosen)
    maps = chosen.scenarios[: arguments.limit]
    # Deferred: `--help` and a wrong call should not wait for torch.
    from .coplan.figure import save_trajectories
    from .coplan.rollouts import coplan
    from .summary import not_measured, percent, summarise

    policy = policy_of(arguments.policy, arguments)
    protocol = protocol_of(arguments, [(str(arguments.policy), policy.conditions)])
    with progress_bar(len(maps) * arguments.repeats, "episodes") as bar:
        outcomes = coplan(
            policy,
            maps,
            protocol.physics,
            repeats=arguments.repeats,
            fps=protocol.fps,
            seed=arguments.seed,
            on_step=lambda finished: bar.update(finished - bar.n),
        )
    summary = summarise(outcomes, policy)
    result = {
        "study": "coplan",
        "label": "co-planning in simulation: both players act on one sampled plan, no person took part",
        "policy": policy.describe(),
        "settings": {
            "maps": chosen.label,
            "map_set": chosen.describe(),
            "orientations": arguments.orientations,
            "map_count": len(maps),
            "complete_set": arguments.limit is None,
            "repeats": arguments.repeats,
            **study_settings(arguments, protocol, maps),
        },
        "summary": summary,
        **not_measured(task, summary),
        "episodes": [outcome.to_json() for outcome in outcomes],
    }
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    success, force = summary["success"], summary["interaction_force"]
    title = f"co-planning on {chosen.label}: {percent(success)} of {success['episodes']} episodes"
    if task.outline is not None:
        save_trajectories(outcomes, picture, title)
    write_json(arguments.out, result)  # last, so that a result is there whole or not at all
    return {
        "success": percent(success),
        "episodes": success["episodes"],
        "ended_by": summary["ended_by"],
        "time_to_completion_s": summary["time_to_completion_s"]["mean"],
        **({} if force is None else {"interaction_force": force["mean"]}),
        "planning_ms_per_call": summary["planning_ms_per_call"]["p50"],
        "result": str(arguments.out),
        "picture": str(picture) if task.outline is not None else task.missing("outline"),
        **not_measured(task, summary),
    }
