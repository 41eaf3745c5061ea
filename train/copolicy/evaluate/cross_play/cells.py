"""Runs the cells of a cross-play and stores each in a file, so that a stopped run continues."""

import json
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, TypedDict

import numpy as np

from copolicy.dataset.files.json_file import read_json
from copolicy.dataset.task import PairTask

from ..file_names import file_name
from ..partner_study.robots import StudyRobot
from ..partner_study.study import run_with_partners
from ..partners.partner import StudyPartner
from ..stored_settings import require_same_settings, without_run
from ..trajectories import trajectories_beside, write_result
from ..trajectory_sources import CELLS
from .measures import episode_rows

OWN_KIND = "own-kind"
"""Row of the matrix in which each partner meets its own kind."""


class CellDocument(TypedDict):
    """The file of a cell."""

    study: str
    robot: str
    partner: str
    settings: dict[str, Any]
    wall_s: float
    planning_ms_per_call: float | None
    episodes: list[dict[str, Any]]


@dataclass(frozen=True)
class Play:
    """What all cells of a cross-play share.

    Attributes:
        scenarios: starts, except of a `replay`.
        settings: of the world.
        fps: actions per second of a robot.
        described: settings that determine the episodes, for the files of the cells.
    """

    task: PairTask
    scenarios: Sequence[Any]
    settings: Any
    fps: Callable[[StudyRobot], int]
    repeats: int
    seed: int
    partner_seed: int
    described: Mapping[str, Any]


def own_kind_robot(partner: StudyPartner, repeats: int) -> StudyRobot:
    """A robot of a partner's own kind; `partner.own_kind` must not be None."""
    own_kind = partner.own_kind
    assert own_kind is not None, partner.no_own_kind
    described = {"type": OWN_KIND, "of": partner.name}
    return StudyRobot(OWN_KIND, lambda seed, fps: own_kind(seed, repeats), lambda: described, partner.own_policy)


def cell_file(out: Path, robot: str, partner: str) -> Path:
    """The file of a cell: readable names, and a check sum of the exact ones."""
    readable = "--".join(file_name(name) for name in (robot, partner))
    return out / CELLS / f"{readable}--{zlib.crc32(repr((robot, partner)).encode()):08x}.json"


def run_cell(
    out: Path,
    play: Play,
    robot: StudyRobot,
    partner: StudyPartner,
    overwrite: bool = False,
    trajectories: bool = False,
) -> CellDocument:
    """The episodes of a robot with a partner: read from the cell's file if it is there, else run and stored.

    A cell of an earlier version, which did not count adaptations, is run again.

    Args:
        trajectories: also store the trajectories; a cell without them is run again.

    Raises:
        InvalidValueError: the file has other settings than this run.
        FileFormatError: the file is no cell.
    """
    path = cell_file(out, robot.name, partner.name)
    settings = _described(play, robot, partner)
    if path.exists() and not overwrite:
        stored = read_json(path, CellDocument, "a cell of a cross-play")
        require_same_settings(path, stored["settings"], settings)
        has_trajectories = trajectories_beside(path).exists()
        complete = all("adaptations" in row for row in stored["episodes"])
        if complete and (has_trajectories or not trajectories):
            return stored
        # Only --overwrite removes trajectories.
        trajectories = trajectories or has_trajectories
    already = 0 if robot.policy is None else len(robot.policy.inference_seconds)
    started = perf_counter()
    episodes = run_with_partners(
        robot,
        play.scenarios,
        [partner],
        play.settings,
        task=play.task,
        repeats=play.repeats,
        fps=play.fps(robot),
        seed=play.seed,
        partner_seed=play.partner_seed,
    )
    wall_s = perf_counter() - started
    inference = [] if robot.policy is None else robot.policy.inference_seconds[already:]
    cell: CellDocument = {
        "study": "cross-play cell",
        "robot": robot.name,
        "partner": partner.name,
        "settings": settings,
        "wall_s": wall_s,
        "planning_ms_per_call": 1e3 * float(np.median(inference)) if inference else None,
        "episodes": episode_rows(play.task, robot.name, episodes),
    }
    label = f"{robot.name} with {partner.name}, no person took part in the study"
    named = ((robot.name, episode) for episode in episodes)
    write_result(path, cell, play.task, label, named if trajectories else None)
    return cell


def _described(play: Play, robot: StudyRobot, partner: StudyPartner) -> dict[str, Any]:
    described = {
        **play.described,
        "fps": play.fps(robot),
        "robot": without_run(robot.describe()),
        "partner": without_run(partner.describe()),
        **({} if partner.recorded is None else {"recorded_sha256": partner.recorded.sha256}),
    }
    return json.loads(json.dumps(described))  # as it is read again: tuples are lists
