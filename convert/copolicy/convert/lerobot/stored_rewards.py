"""Whether the rewards in a data set are those that this version gives."""

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
_FRAMES = 500  # of a file that are looked at


def foreign_rewards(roots: Sequence[Path]) -> list[str]:
    """A line for each data set whose rewards follow another definition; some frames are looked at.

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
    """The reward of a frame is that of the state that follows; what follows an episode's last one is not stored."""
    table = read_parquet(path).sort_by("index")
    episodes, index = (table.column(name).to_numpy() for name in ("episode_index", "index"))
    followed = np.flatnonzero((np.diff(episodes) == 0) & (np.diff(index) == 1))
    places = followed[:: max(1, len(followed) // _FRAMES)]
    rows = table.take(places).select([ENVIRONMENT_STATE, _REWARD]).to_pylist()
    states = table.take(places + 1).column(STATE).to_pylist()
    largest = 0.0
    for row, state in zip(rows, states, strict=True):
        try:
            scenario = task.scenario_of_vector(np.array(row[ENVIRONMENT_STATE]), {})
        except InvalidValueError:
            continue  # no scenario of this task, which the checks name
        (stored,) = np.ravel(row[_REWARD])
        (given,) = task.rewards(scenario, np.array([state]))
        error = abs(float(given) - float(stored))
        if not math.isfinite(error):
            return math.inf
        largest = max(largest, error)
    return largest
