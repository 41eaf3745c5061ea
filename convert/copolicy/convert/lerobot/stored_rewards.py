"""Compares the rewards stored in a data set with the definition of this version."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.features import ENVIRONMENT_STATE, STATE
from copolicy.dataset.files.listing import visible_files
from copolicy.dataset.lerobot_folder.info import read_info, task_of
from copolicy.dataset.lerobot_folder.tables import read_parquet
from copolicy.dataset.task import PairTask

_REWARD = "next.reward"
_TOLERANCE = 1e-3  # rewards and positions are stored in single precision
_FRAMES = 500  # frames compared per file


def reward_differences(roots: Sequence[Path]) -> list[str]:
    """Returns a line for each data set whose rewards follow another definition; compares a sample of frames.

    Raises:
        FileFormatError: a data file is not complete.
    """
    errors = {}
    for root in roots:
        task, files = task_of(read_info(root)), visible_files(root / "data", "*.parquet")
        errors[root] = max((_largest_error(path, task) for path in files), default=0.0)
    return [
        f"rewards: those of {root.name} differ by up to {error:.3g} from this version's definition"
        for root, error in errors.items()
        if not error <= _TOLERANCE
    ]


def _largest_error(path: Path, task: PairTask) -> float:
    """Compares each sampled frame but an episode's last: its reward is that of the next state."""
    table = read_parquet(path).sort_by("index")
    episodes, index = (table.column(name).to_numpy() for name in ("episode_index", "index"))
    followed = np.flatnonzero((np.diff(episodes) == 0) & (np.diff(index) == 1))
    sampled = followed[:: max(1, len(followed) // _FRAMES)]
    rows = table.take(sampled).select([ENVIRONMENT_STATE, _REWARD]).to_pylist()
    states = table.take(sampled + 1).column(STATE).to_pylist()
    largest = 0.0
    for row, state in zip(rows, states, strict=True):
        try:
            scenario = task.scenario_of_vector(np.array(row[ENVIRONMENT_STATE]), {})
        except InvalidValueError:
            continue  # no scenario of this task: the checks report it
        (stored,) = np.ravel(row[_REWARD])
        (expected,) = task.rewards(scenario, np.array([state]))
        error = abs(float(expected) - float(stored))
        if not math.isfinite(error):
            return math.inf
        largest = max(largest, error)
    return largest
