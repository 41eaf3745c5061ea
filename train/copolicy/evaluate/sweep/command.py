"""`copolicy-eval sweep`."""

import argparse
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import Commands, add_command
from copolicy.dataset.command_line.extras import BACKEND_PACKAGES, FIGURES, POLICIES
from copolicy.dataset.command_line.flag_numbers import LARGEST_SEED, add_whole_number, whole_number
from copolicy.dataset.distributed.flags import add_distribution_flags, distribution_from_flags
from copolicy.dataset.exceptions import InvalidValueError, RunError
from copolicy.dataset.files.lock import FolderLock

from ..partner_study.command import add_overlap_flag
from ..partner_study.configurations import DEFAULT_STARTS
from ..partners.names import PARTNERS_HELP
from ..study_flags import add_protocol_flags
from ..trajectories import add_trajectories_flag
from .plan import LOCK_FILE, TABLES, SweepPlan, require_own_folder

_EXAMPLE = (
    "copolicy-eval sweep --runs CoDP-H=outputs/codp-h BC=outputs/bc --partners stubborn slow --out outputs/sweep "
    "--workers 4\n  Each folder has the runs of one method: codp-h/seed_0/training, codp-h/seed_1/training, ..."
)


def add_sweep_command(commands: Commands) -> None:
    """Adds `sweep` to the commands of `copolicy-eval`."""
    command = add_command(
        commands,
        "sweep",
        _sweep,
        "methods x seeds x map sets x studies (co-planning and each partner) as restartable tasks, here or on a "
        "cluster; a second call does what is missing",
        _EXAMPLE,
        _needs,
    )
    command.add_argument(
        "--runs",
        nargs="+",
        metavar="[NAME=]DIR",
        help="folder with the runs of one method, one per training seed, or a single run (default name: policy type "
        "and preset)",
    )
    command.add_argument(
        "--maps",
        nargs="+",
        metavar="NAME|FILE[#SPLIT]",
        help="map sets (default: holdout and unseen, or the first set of a task without them)",
    )
    command.add_argument("--partners", nargs="+", metavar="PARTNER", help=f"{PARTNERS_HELP} (default: none)")
    command.add_argument("--no-coplanning", action="store_true", help="only the studies with partners")
    command.add_argument(
        "--out",
        required=True,
        type=Path,
        metavar="FOLDER",
        help=f"folder of {', '.join(TABLES)} and of a result per task; on a cluster, all nodes must share it",
    )
    command.add_argument(
        "--collect", action="store_true", help="only make the table of what is finished, as after SLURM jobs"
    )
    add_trajectories_flag(command, "beside the result of each task; a finished task without them is run again")
    add_overlap_flag(command)
    command.add_argument("--orientations", action="store_true", help="co-planning: each map with four orientations")
    add_whole_number(command, "--limit", "co-planning: use only the first N maps; recorded in the results")
    starts = f"partners: number of starts, as in `partner` (default: {DEFAULT_STARTS}, or all of a smaller set)"
    add_whole_number(command, "--configurations", starts)
    add_whole_number(command, "--repeats", "episodes per map or start (default: 1)", 1, 1, 10_000)
    add_whole_number(command, "--partner-seed", "seed of the partners (default: 0)", 0, 0, LARGEST_SEED)
    executed = "partners: actions executed of each action chunk (default: 1); --n-action-steps is that of co-planning"
    add_whole_number(command, "--partner-n-action-steps", executed, 1)
    command.add_argument("--device", default="cpu", help="default: cpu")
    add_protocol_flags(command, 8, "run tasks again whose result has other settings or weights")
    group = command.add_argument_group(
        "where tasks run",
        "A task is a study of one training run on one map set. Killed processes lose no finished task; results do not "
        "depend on the executor or the number of workers.",
    )
    add_distribution_flags(group, "task")
    threads = whole_number("--threads", 1, 1024)
    group.add_argument("--threads", type=threads, default=1, metavar="N", help="threads of a task (default: 1)")


def _needs(arguments: argparse.Namespace) -> tuple[str, ...]:
    return () if arguments.collect else (*POLICIES, *FIGURES, "datatrove", *BACKEND_PACKAGES.get(arguments.backend, ()))


def _sweep(arguments: argparse.Namespace) -> dict[str, Any]:
    out = arguments.out.absolute()
    distribution = distribution_from_flags(arguments)
    if arguments.collect:
        return _collected(out, {})
    if not arguments.runs:
        raise InvalidValueError("--runs", "at least one folder with training runs, or --collect", "none")
    distribution.require()
    require_own_folder(out)
    # Imported here so that `--help` and argument errors do not wait for datatrove.
    from copolicy.dataset.distributed.executors import run_tasks, submit_slurm

    from .planning import make_plan
    from .steps import collect_job, sweep_job

    plan = make_plan(arguments)
    with FolderLock(out / LOCK_FILE, f"{out}: expected a sweep that no other call works on, found one at work"):
        finished = plan.prepare(arguments.overwrite)
        counts = {"tasks": len(plan.tasks), "finished_before": finished}
        if distribution.executor == "slurm":
            jobs = submit_slurm(sweep_job(plan), collect_job(plan), distribution)
            return {**counts, "jobs": jobs, "table": f"{out / TABLES[1]} after the jobs"}
        _run(plan, run_tasks(sweep_job(plan), distribution))
        return _collected(out, counts)


def _run(plan: SweepPlan, errors: list) -> None:
    """Raises one error for all failed tasks."""
    if errors:
        more = f" (and {len(errors) - 1} more failed tasks)" if len(errors) > 1 else ""
        progress = f"{plan.finished()} of {len(plan.tasks)} tasks are finished and kept in {plan.out}"
        raise RunError(f"{errors[0]}{more}; {progress}")


def _collected(out: Path, counts: dict[str, int]) -> dict[str, Any]:
    from .collect import collect

    table = collect(out)
    missing = {"missing": len(table["missing"]), "exit_status": 1} if table["missing"] else {}
    return {
        **(counts or {"tasks": len(table["tasks"]) + len(table["missing"])}),
        "label": "simulated, no person took part",
        "success": {
            f"{group['method']}, {group['maps']}, {group['partner']}": _percent(group["success"], group["seeds"])
            for group in table["groups"]
        },
        "results_sha256": table["results_sha256"],
        **missing,
        "table": str(out / TABLES[1]),
    }


def _percent(success: dict[str, Any], seeds: int) -> str:
    error = success["standard_error"]
    unit = f"over {seeds} seeds" if seeds > 1 else "over maps, one seed"
    return f"{100 * success['mean']:.1f} %" if error is None else (
        f"{100 * success['mean']:.1f} ± {100 * error:.1f} % ({unit})"
    )  # fmt: skip
