"""Reads the recordings of a study as rows, one per episode."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.collect.session import iter_recordings
from copolicy.dataset.episode import Episode
from copolicy.dataset.exceptions import FileFormatError, RunError
from copolicy.dataset.recording.reader import Recording, read_recording
from copolicy.dataset.task import get_task

from ..coplan.rollouts import interaction_columns
from ..study_flags import task_entry
from .plan import StudyPlan
from .schedule import CODE_PREFIX

_CHUNK_TIMES = re.compile(r"seat 0: \d+ plans, p50 (?P<p50>[\d.]+) ms(?:, mean (?P<mean>[\d.]+) ms)?")
_DURATION = re.compile(r"wall (?P<wall>[\d.]+) s, paused (?P<paused>[\d.]+) s")


def study_rows(folders: Sequence[Path], plan: StudyPlan | None) -> tuple[list[dict[str, Any]], dict[str, int]]:
    """Reads the counted episodes in folders, and counts the others by the reason for which they are left out.

    Args:
        plan: plan of the study; if None, robots are named as in the recordings.

    Raises:
        FileFormatError: a recording is damaged or contradicts the plan.
        RunError: no episode counts.
    """
    rows: list[dict[str, Any]] = []
    left_out: dict[str, int] = {}
    paths: dict[tuple[str, str], Path] = {}
    for file in (recording for folder in folders for recording in iter_recordings(folder)):
        recording = read_recording(file.path)
        reason = _reason_left_out(recording.episode, file.counts, plan)
        if reason:
            left_out[reason] = left_out.get(reason, 0) + 1
            continue
        row = _row(file.path, recording, plan)
        trial = (row["participant"], row["trial"])
        if plan and trial in paths:
            raise FileFormatError(file.path, f"one kept recording of {' '.join(trial)}", f"another in {paths[trial]}")
        paths[trial] = file.path
        rows.append(row)
    if not rows:
        names = ", ".join(map(str, folders))
        raise RunError(f"{names}: expected kept recordings of the study, found none (left out: {left_out or 'none'})")
    return rows, left_out


def _reason_left_out(episode: Episode, counts: bool, plan: StudyPlan | None) -> str:
    meta = episode.meta
    if not counts:
        return "practice, discarded or interrupted"
    if plan and not meta.controller_0.startswith(f"{CODE_PREFIX}:{plan.plan_id}:"):
        swapped = meta.controller_1.startswith(f"{CODE_PREFIX}:{plan.plan_id}:")
        return "seats swapped" if swapped else "not of this plan"
    return ""


def _row(path: Path, recording: Recording, plan: StudyPlan | None) -> dict[str, Any]:
    episode = recording.episode
    meta = episode.meta
    after = np.vstack((episode.states[1:], episode.final_state))
    task = get_task(episode.task)
    row: dict[str, Any] = {
        **task_entry(task),
        "participant": meta.pair_id,
        "trial": "",
        "block": 0,
        "robot": meta.controller_0,
        "human": meta.controller_1,
        "source": meta.source,
        "map_id": meta.map_id,
        "front": task.studies.front(episode.map_config),
        **task.studies.factors(episode.map_config),
        "success": meta.success,
        "reason": meta.termination_reason,
        "steps": len(episode.actions),
        "time_s": len(episode.actions) / task.spec.record_hz,
        "wall_time_s": _event_number(recording, "duration", _DURATION, "wall"),
        "paused_s": _event_number(recording, "duration", _DURATION, "paused"),
        **interaction_columns(task.interaction(after, episode.actions)),
        "planning_ms": _event_number(recording, "plans", _CHUNK_TIMES, "mean"),
        "planning_p50_ms": _event_number(recording, "plans", _CHUNK_TIMES, "p50"),
        "quality_flags": meta.quality_flags,
        "recording": path.name,
        "session_id": meta.session_id,
    }
    if plan is None:
        return row
    _, _, participant, code = meta.controller_0.split(":", 3)
    trial = next((trial for trial in plan.trials_of(participant) if trial.code == code), None)
    if trial is None or participant != meta.pair_id:
        raise FileFormatError(path, f"a trial of {meta.pair_id} in plan {plan.plan_id}", meta.controller_0)
    planned = plan.configurations[trial.configuration]
    if planned != episode.map_config:
        raise FileFormatError(path, f"the start that plan {plan.plan_id} has for {participant} {code}", meta.map_id)
    if episode.physics != plan.world_settings:
        raise FileFormatError(path, f"the physics of plan {plan.plan_id}", str(episode.physics))
    return {**row, "trial": code, "block": trial.block, "robot": trial.robot}


def _event_number(recording: Recording, kind: str, pattern: re.Pattern[str], name: str) -> float | None:
    """A number in the text of an event; None if the recording has none, being of an earlier version."""
    for event in recording.events:
        found = pattern.search(event.detail) if event.kind == kind else None
        if found and found[name] is not None:
            return float(found[name])
    return None
