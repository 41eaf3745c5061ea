"""Runs the study of one task of a sweep, and writes its result."""

from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import version
from time import perf_counter
from typing import Any

import torch

from copolicy.dataset.exceptions import RunError

from ..coplan.rollouts import EpisodeResult
from ..coplan.study import coplan_result, coplan_settings
from ..coplanning_table.training_runs import TrainingRun
from ..partner_study.robots import policy_robot
from ..partner_study.settings import partner_settings
from ..partner_study.study import run_with_partners
from ..partner_study.summary import definitions, summarise_with_partners
from ..partners.names import PartnerName, partners_label
from ..partners.partner import make_partner
from ..stored_settings import without_run
from ..study_flags import POLICY_SETTINGS, study_policy, study_settings
from ..summary import not_measured
from ..trajectories import write_result
from .determinants import determined_by, digest, starts_of
from .plan import SweepPlan, SweepTask

_Study = tuple[dict[str, Any], Sequence[EpisodeResult]]  # its result, and its episodes


def run_task(plan: SweepPlan, rank: int) -> None:
    """Runs a task unless it is finished; first removes a partial file of a killed process.

    The result appears complete, in one rename, or not at all, and after its trajectories, if the plan stores them. All
    but wall times depends on `determined_by` alone.

    Raises:
        RunError: the policy or the partner is not that of the plan any more.
    """
    task = plan.tasks[rank]
    if plan.is_finished(task):
        return
    for partial in task.file.parent.glob(f".{task.file.stem}.*.partial"):
        partial.unlink(missing_ok=True)
    started = perf_counter()
    with _threads(plan.flags.threads):
        study = _coplanning(plan, task) if task.partner is None else _with_partner(plan, task, task.partner)
    result, episodes = study
    _require_unchanged(plan, task)
    result["policy"]["checkpoint"] = task.source  # not relative to the folder of a worker
    sweep = {
        **task.key,
        "seed": task.seed,
        "version": version("lerobot_policy_copolicy"),
        "wall_s": perf_counter() - started,
        "episodes_sha256": digest([task.determined_by, result["episodes"]]),
        "determined_by": task.determined_by,
    }
    named = ((task.robot, episode) for episode in episodes)
    world, label = plan.protocol(task).task, result["label"]
    write_result(task.file, {**result, "sweep": sweep}, world, label, named if plan.trajectories else None)


def _coplanning(plan: SweepPlan, task: SweepTask) -> _Study:
    protocol, flags = plan.protocol(task), _arguments(plan, plan.flags.n_action_steps, 8)
    policy = study_policy(task.checkpoint, flags)
    chosen = plan.map_sets[task.maps]
    chosen = protocol.task.turned(chosen) if plan.flags.orientations else chosen
    settings = coplan_settings(flags, protocol, chosen)
    return coplan_result(policy, protocol, chosen.scenarios[: plan.flags.limit], settings)


def _with_partner(plan: SweepPlan, task: SweepTask, named: PartnerName) -> _Study:
    protocol, flags = plan.protocol(task), _arguments(plan, plan.flags.partner_n_action_steps, 1)
    policy = study_policy(task.checkpoint, flags)
    chosen = _map_set(plan, task)
    scenarios = starts_of(protocol.task, chosen, named, plan.flags)
    partner = make_partner(named, protocol.task, protocol, plan.flags.device, len(scenarios))
    if partner.recorded is not None:
        scenarios = partner.recorded.scenarios
    episodes = run_with_partners(
        policy_robot(task.method, policy),
        scenarios,
        [partner],
        protocol.settings,
        task=protocol.task,
        repeats=plan.flags.repeats,
        fps=task.fps,
        seed=plan.flags.seed,
        partner_seed=plan.flags.partner_seed,
    )
    summary = summarise_with_partners(episodes, policy)
    settings = partner_settings(chosen, len(scenarios), [partner], plan.flags.partner_seed, plan.flags.repeats)
    result = {
        "study": "partner",
        "label": partners_label([named], protocol.task),
        "name": task.method,
        "policy": policy.describe(),
        "settings": {
            **settings,
            "partners": without_run(settings["partners"]),
            **study_settings(flags, protocol, scenarios),
            **({"starts": "the recorded ones of the replay"} if partner.recorded is not None else {}),
        },
        "summary": summary,
        **_overlap(plan, task),
        **not_measured(protocol.task, summary),
        "definitions": definitions(protocol.task, summary),
        "episodes": [episode.to_json() for episode in episodes],
    }
    return result, episodes


def _overlap(plan: SweepPlan, task: SweepTask) -> dict[str, Any]:
    """The `overlap` entry of a result: pairs that both the robot and the partner learned from."""
    shared = plan.overlap.get("shared", {}).get(task.robot, {}).get(task.key["partner"])
    return {"overlap": {"allowed": True, "shared": shared}} if shared else {}


def _map_set(plan: SweepPlan, task: SweepTask) -> Any:
    """The map set of a task with a partner; that of a `replay` only says how many starts there are."""
    return plan.map_sets.get(task.maps) or next(iter(plan.map_sets.values()))


def _arguments(plan: SweepPlan, n_action_steps: int | None, default: int) -> Namespace:
    """The flags of a single study, as its functions read them."""
    flags = plan.flags
    return Namespace(
        **{name: flags.overrides.get(name) for name in POLICY_SETTINGS},
        n_action_steps=n_action_steps,
        default_n_action_steps=default,
        orientations=flags.orientations,
        limit=flags.limit,
        repeats=flags.repeats,
        seed=flags.seed,
        device=flags.device,
    )


def _require_unchanged(plan: SweepPlan, task: SweepTask) -> None:
    run = TrainingRun.read(task.checkpoint)
    protocol = replace(plan.protocol(task), fps=run.conditions.fps)
    found = determined_by(run, _map_set(plan, task), task.partner, protocol, plan.flags)
    for name, value in task.determined_by.items():
        if found.get(name) != value:
            expected = f"{name} as at the start of the sweep"
            raise RunError(f"{task.source} on {task.maps}: expected {expected}, found others; nothing was written")


@contextmanager
def _threads(count: int) -> Iterator[None]:
    """Limits torch to a number of threads, on which the last digits of its sums depend."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
