"""`copolicy-eval`: the paper's studies of a policy checkpoint."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import add_command, add_group, command_parser, progress_bar, run
from copolicy.dataset.command_line.flag_numbers import add_whole_number
from copolicy.dataset.command_line.maps_flag import add_maps_flag, map_set_name
from copolicy.dataset.files.staging import require_new

from .behaviours import add_behaviours_command
from .comparison import add_compare_command
from .coplanning_table import add_coplanning_table_command
from .cross_play import add_cross_play_command
from .figures.command import add_figures_command
from .human_study import add_human_command
from .human_table import add_human_table_command
from .partner_study import add_partner_command
from .partners.command import add_partners_command
from .plans.command import add_plans_command
from .study_flags import (
    POLICY_HELP,
    add_study_flags,
    checkpoint_task,
    figure_beside,
    study_needs,
    study_policy,
    study_protocol,
)
from .sweep import add_sweep_command
from .trajectories import BESIDE_RESULT, add_trajectories_flag, trajectories_beside
from .within_subject.command import add_power_command

_DEFAULT_MAPS = "holdout"
_TABLES = (
    "copolicy-eval table coplanning --runs CoDP-H=outputs/codp-h BC=outputs/bc --out outputs/table",
    "copolicy-eval table human --recordings study/recordings --plan study/plan.json --out study/table",
)


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `copolicy-eval`."""
    parser, commands = command_parser("copolicy-eval", "Evaluate policies with the paper's studies.")
    coplan = add_command(
        commands,
        "coplan",
        _coplan,
        "both players execute one sampled action chunk, on all maps of a set",
        "copolicy-eval coplan --policy outputs/run/checkpoints/last/pretrained_model --maps holdout --out eval.json",
        study_needs,
    )
    coplan.add_argument("--policy", required=True, type=Path, help=POLICY_HELP)
    add_maps_flag(coplan, _DEFAULT_MAPS, use_default=False)
    coplan.add_argument("--orientations", action="store_true", help="run each map with four start orientations")
    add_whole_number(coplan, "--repeats", "episodes per map (default: 1)", 1, 1, 10_000)
    add_whole_number(coplan, "--limit", "use only the first N maps; recorded in the result")
    add_trajectories_flag(coplan, BESIDE_RESULT)
    coplan.add_argument("--out", required=True, type=Path, help="result file (JSON); the figure is written beside it")
    add_study_flags(coplan, n_action_steps=8)
    add_partner_command(commands)
    add_cross_play_command(commands)
    add_partners_command(commands)
    add_human_command(commands)
    add_behaviours_command(commands)
    add_compare_command(commands)
    add_plans_command(commands)
    add_figures_command(commands)
    add_power_command(commands)
    add_sweep_command(commands)
    help = "tables of the paper, from training runs and from recordings with people"
    tables = add_group(commands, "table", help, help, _TABLES)
    add_coplanning_table_command(tables)
    add_human_table_command(tables)
    return run(parser, argv)


def _coplan(arguments: argparse.Namespace) -> dict[str, Any]:
    figure, trajectories = figure_beside(arguments.out), trajectories_beside(arguments.out)
    require_new(arguments.out, figure, trajectories, overwrite=arguments.overwrite)
    task = checkpoint_task(arguments.policy)
    chosen = task.scenario_set(map_set_name(task, arguments.maps, _DEFAULT_MAPS))
    if arguments.orientations:
        chosen = task.turned(chosen)
    # Imported here so that `--help` and argument errors do not wait for torch.
    from .coplan.study import coplan_settings, write_coplan_result
    from .summary import percent

    policy = study_policy(arguments.policy, arguments)
    protocol = study_protocol(arguments, [(str(arguments.policy), policy.conditions)])
    scenarios = chosen.scenarios[: arguments.limit]
    with progress_bar(len(scenarios) * arguments.repeats, "episodes") as bar:
        settings = coplan_settings(arguments, protocol, chosen)
        result = write_coplan_result(
            policy, protocol, scenarios, settings, arguments.out, bar, trajectories=arguments.trajectories
        )
    summary, task = result["summary"], protocol.task
    success, force = summary["success"], summary["interaction_force"]
    return {
        "success": percent(success),
        "episodes": success["episodes"],
        "ended_by": summary["ended_by"],
        "time_to_completion_s": summary["time_to_completion_s"]["mean"],
        **({} if force is None else {"interaction_force": force["mean"]}),
        "planning_ms_per_call": summary["planning_ms_per_call"]["p50"],
        "result": str(arguments.out),
        "figure": str(figure) if task.outline is not None else task.missing("outline"),
        **({"trajectories": str(trajectories)} if arguments.trajectories else {}),
        **{name: result[name] for name in ("not_measured",) if name in result},
    }
