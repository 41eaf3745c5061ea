"""The tasks of a sweep: the file of the result of each, and which are finished. Needs no torch."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypedDict

from copolicy.dataset.exceptions import OutputExistsError
from copolicy.dataset.files.json_file import read_json
from copolicy.dataset.files.staging import replace_json
from copolicy.dataset.scenarios import ScenarioSet
from copolicy.dataset.task import get_task

from ..file_names import file_name
from ..partners.names import PartnerName
from ..stored_settings import require_same_settings
from ..study_flags import Protocol
from ..trajectories import trajectories_beside
from .determinants import StudyFlags, digest

COPLANNING = "co-planning"
"""Stands for the partner in the co-planning study, which has none."""

RECORDED = "recorded"
"""Stands for the map set of a `replay`, which acts in its own starts only."""

LOCK_FILE, PLAN_FILE, NAME = "lock", "plan.json", "sweep"
TABLES = tuple(f"{NAME}{suffix}" for suffix in (".json", ".md", ".csv"))


class SweepEntry(TypedDict):
    """The entry `sweep` of a task's result."""

    determined_by: dict[str, Any]


class TaskResult(TypedDict):
    """The parts of a task's result that are read: that of a study, with one further entry."""

    study: str
    sweep: SweepEntry
    episodes: list[dict[str, Any]]


@dataclass(frozen=True)
class SweepTask:
    """A study of one training run on one map set.

    Attributes:
        run: its training seed, or the first digits of its weights' sha256 if it does not state one.
        source: folder of its weights, as results name it.
        checkpoint: the same, absolute.
        maps: label of the map set, or `RECORDED`.
        partner: None for co-planning.
        fps: actions per second of the policy.
        determined_by: JSON that determines the episodes.
        file: of the result.
    """

    method: str
    run: str
    seed: int | None
    source: str
    checkpoint: Path
    maps: str
    partner: PartnerName | None
    fps: int
    determined_by: Mapping[str, Any]
    file: Path

    @property
    def robot(self) -> str:
        """Name of the training run."""
        return f"{self.method} {self.run}"

    @property
    def key(self) -> dict[str, Any]:
        """What identifies it in the sweep."""
        return {"method": self.method, "run": self.run, "maps": self.maps, "partner": partner_label(self.partner)}


@dataclass(frozen=True)
class SweepPlan:
    """All tasks of a call. It is pickled for workers, which may have another working folder.

    Attributes:
        world: settings of the world.
        contradictions: see `Protocol`.
        map_sets: by label.
        overlap: see `check_overlap`.
        trajectories: also store those of each task; a task without them is run again.
    """

    out: Path
    task: str
    world: Any
    contradictions: tuple[str, ...]
    flags: StudyFlags
    map_sets: Mapping[str, ScenarioSet]
    tasks: tuple[SweepTask, ...]
    overlap: Mapping[str, Any]
    trajectories: bool = False

    @property
    def logs(self) -> Path:
        """datatrove's folder for the tasks: completion marks, logs, job scripts."""
        return self.out / "datatrove" / "tasks"

    @property
    def collect_logs(self) -> Path:
        """datatrove's folder for the job that makes the table."""
        return self.out / "datatrove" / "collect"

    def protocol(self, task: SweepTask) -> Protocol:
        """The protocol of the study of a task."""
        return Protocol(get_task(self.task), task.fps, self.world, self.contradictions)

    def is_finished(self, task: SweepTask) -> bool:
        """Whether the result of a task exists and has its settings, and its trajectories exist if they are stored."""
        return task.file.exists() and _stored(task.file) == task.determined_by and self._has_trajectories(task)

    def _has_trajectories(self, task: SweepTask) -> bool:
        return not self.trajectories or trajectories_beside(task.file).exists()

    def finished(self) -> int:
        """Number of finished tasks."""
        return sum(self.is_finished(task) for task in self.tasks)

    def prepare(self, overwrite: bool) -> int:
        """Stores the plan, and marks the finished tasks for the executor.

        Args:
            overwrite: delete results with other settings.

        Returns:
            Number of finished tasks.

        Raises:
            InvalidValueError: a result has other settings or weights, without `overwrite`.
            FileFormatError: a file of a result is none.
        """
        finished = set()
        outdated = []
        for rank, task in enumerate(self.tasks):
            if not task.file.exists():
                continue
            stored = _stored(task.file)
            if stored == task.determined_by:
                if self._has_trajectories(task):
                    finished.add(f"{rank:05d}")
            elif overwrite:
                outdated.append(task.file)
            else:
                require_same_settings(task.file, stored, task.determined_by)
        for path in outdated:
            trajectories_beside(path).unlink(missing_ok=True)
            path.unlink()
        entries = [
            {**task.key, "seed": task.seed, "file": task.file.relative_to(self.out).as_posix(),
             "determined_by_sha256": digest(task.determined_by)}
            for task in self.tasks
        ]  # fmt: skip
        replace_json(self.out / PLAN_FILE, {"study": NAME, "overlap": dict(self.overlap), "tasks": entries}, indent=1)
        _mark(self.logs / "completions", finished)
        _mark(self.collect_logs / "completions", set())
        return len(finished)


def require_own_folder(out: Path) -> None:
    """Refuses a folder with files of a table's names that are not of a sweep.

    Raises:
        OutputExistsError: there is such a file.
    """
    if not (out / PLAN_FILE).exists():
        for path in (out, *(out / name for name in TABLES)):
            if path.exists() and not path.is_dir():
                raise OutputExistsError(path)


def task_file(out: Path, method: str, run: str, maps: str, partner: str) -> Path:
    """The file of a task: readable names, and a check sum of the exact ones."""
    names = (method, run, maps, partner)
    readable = "--".join(file_name(name)[:40] for name in names)
    return out / "tasks" / f"{readable}--{zlib.crc32(repr(names).encode()):08x}.json"


def partner_label(partner: PartnerName | None) -> str:
    """Name of a study in tables."""
    return COPLANNING if partner is None else partner.name


def _stored(path: Path) -> dict[str, Any]:
    return read_json(path, TaskResult, "the result of a task of a sweep")["sweep"]["determined_by"]


def _mark(completions: Path, finished: set[str]) -> None:
    """Makes the completion marks of an executor those of the finished ranks."""
    completions.mkdir(parents=True, exist_ok=True)
    for path in completions.iterdir():
        if path.name not in finished:
            path.unlink()
    for name in finished:
        (completions / name).touch()
