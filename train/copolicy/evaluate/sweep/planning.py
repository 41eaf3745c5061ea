"""Makes the plan of a sweep from its flags."""

import argparse
import logging
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from copolicy.collect.agents.checkpoint_folder import PRETRAINED, checkpoint_folder
from copolicy.collect.agents.training_conditions import training_conditions
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.scenarios import ScenarioSet
from copolicy.dataset.task import PairTask, get_task

from ..coplanning_table.training_runs import TrainedMethod, TrainingRun, read_trained_methods
from ..partners.names import PROXY, REPLAY, PartnerName, parse_partners
from ..partners.overlap import check_overlap
from ..study_flags import Protocol, study_protocol
from .determinants import StudyFlags, determined_by
from .plan import COPLANNING, RECORDED, SweepPlan, SweepTask, partner_label, task_file

DEFAULT_MAPS = ("holdout", "unseen")


def make_plan(arguments: argparse.Namespace) -> SweepPlan:
    """The tasks in the order methods, runs, map sets, co-planning, partners.

    Raises:
        FileFormatError: a folder has no runs, or runs that are not of one method; a file of a partner cannot be used.
        InvalidValueError: two sets or methods of one name, a partner of the name of co-planning, shared pairs of robots
            and proxies, or other wrong flags.
        UnknownNameError: no such map set or kind of partner.
    """
    methods = read_trained_methods(arguments.runs)
    for method in methods:
        for run in method.runs:
            if run.unfinished:
                logging.warning("warning: %s: the training is not finished (%s)", run.folder, run.unfinished)
    task = get_task(methods[0].runs[0].conditions.task)
    partners = (
        [_with_absolute_path(each) for each in parse_partners(arguments.partners, task)] if arguments.partners else []
    )
    studies: list[PartnerName | None] = [*([] if arguments.no_coplanning else [None]), *partners]
    if any(partner.name == COPLANNING for partner in partners):
        raise InvalidValueError("--partners", f"partners of other names than {COPLANNING}", COPLANNING)
    if not studies:
        raise InvalidValueError("--no-coplanning", "--partners beside it", "none")
    protocol = _protocol(arguments, methods, partners)
    map_sets = _map_sets(protocol.task, arguments.maps)
    robots = {f"{method.name} {_run_name(run)}": run.checkpoint for method in methods for run in method.runs}
    proxies = {partner.name: partner.detail for partner in partners if partner.kind == PROXY}
    overlap = check_overlap(robots, proxies, arguments.allow_overlap)
    flags = StudyFlags.of(arguments)
    out = arguments.out.absolute()
    tasks = [
        _task(out, method, run, maps, chosen, partner, protocol, flags)
        for method in methods
        for run in method.runs
        for maps, chosen, partner in _studies(map_sets, studies)
    ]
    return SweepPlan(
        out, protocol.task.spec.name, protocol.settings, protocol.contradictions, flags,
        {chosen.label: chosen for chosen in map_sets}, tuple(tasks), overlap, arguments.trajectories,
    )  # fmt: skip


def _studies(
    map_sets: Sequence[ScenarioSet], studies: Sequence[PartnerName | None]
) -> list[tuple[str, ScenarioSet, PartnerName | None]]:
    """Label of the maps, map set and partner of each study; a `replay`, which has its own starts, once."""
    found = []
    for chosen in map_sets:
        for partner in studies:
            if partner is None or partner.kind != REPLAY:
                found.append((chosen.label, chosen, partner))
            elif chosen is map_sets[0]:
                found.append((RECORDED, chosen, partner))
    return found


def _task(
    out: Path, method: TrainedMethod, run: TrainingRun, maps: str, chosen: ScenarioSet, partner: PartnerName | None,
    protocol: Protocol, flags: StudyFlags,
) -> SweepTask:  # fmt: skip
    fps, name = run.conditions.fps, _run_name(run)
    settings = determined_by(run, chosen, partner, replace(protocol, fps=fps), flags)
    file = task_file(out, method.name, name, maps, partner_label(partner))
    return SweepTask(
        method.name, name, run.seed, os.path.relpath(run.checkpoint), run.checkpoint.absolute(), maps, partner, fps,
        settings, file,
    )  # fmt: skip


def _run_name(run: TrainingRun) -> str:
    return run.weights[:12] if run.seed is None else str(run.seed)


def _protocol(
    arguments: argparse.Namespace, methods: Sequence[TrainedMethod], partners: Sequence[PartnerName]
) -> Protocol:
    policies: list[tuple[str, Any]] = [(method.name, run.conditions) for method in methods for run in method.runs[:1]]
    for partner in partners:
        if partner.kind == PROXY:
            policies.append((partner.name, training_conditions(checkpoint_folder(partner.detail))))
    return study_protocol(arguments, policies)


def _map_sets(task: PairTask, names: Sequence[str] | None) -> list[ScenarioSet]:
    names = names or [name for name in DEFAULT_MAPS if name in task.scenario_sets] or [next(iter(task.scenario_sets))]
    chosen = [task.scenario_set(name) for name in dict.fromkeys(names)]
    labels = [each.label for each in chosen]
    if len(set(labels)) < len(labels) or RECORDED in labels:
        raise InvalidValueError("--maps", f"sets of different names, other than {RECORDED}", labels)
    return chosen


def _with_absolute_path(partner: PartnerName) -> PartnerName:
    """A partner whose files a worker in another folder finds."""
    if partner.kind not in (PROXY, REPLAY) or partner.detail == PRETRAINED:
        return partner
    return replace(partner, detail=str(Path(partner.detail).absolute()))
