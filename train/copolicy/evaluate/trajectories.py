"""Trajectories of the episodes of a study, in a Parquet file beside the result: for figures and behaviours."""

import argparse
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import CopolicyError, FileFormatError
from copolicy.dataset.files.staging import replace_json, replacement, replacements
from copolicy.dataset.task import PairTask, get_task

if TYPE_CHECKING:
    from .coplan.rollouts import EpisodeResult

SUFFIX = ".trajectories.parquet"
BESIDE_RESULT = f"beside the result as NAME{SUFFIX}"
NamedEpisode = tuple[str, "EpisodeResult"]
"""Name of the robot, and its episode."""

_KEY = b"copolicy"
_EXPECTED = "the trajectories of a study (--trajectories of copolicy-eval)"


@dataclass(frozen=True)
class Trajectory:
    """States and actions of one episode; `actions[k]` acts from `states[k]` to the next state.

    Attributes:
        states: `(T, n)`, see `TaskSpec.state`.
        actions: `(T, 2 m)` joint actions, robot first.
        final_state: `(n,)` state after the last action; None if it is not known, as in a data set.
        fps: states per second.
        scenario: of the task.
        columns: row of the episode in its result, or episode columns of its data set.
    """

    states: Array
    actions: Array
    final_state: Array | None
    fps: int
    scenario: Any
    columns: Mapping[str, Any]

    @property
    def every_state(self) -> Array:
        """`(T, n)` states, or `(T + 1, n)` with the final one if it is known."""
        return self.states if self.final_state is None else np.vstack((self.states, self.final_state))


class Trajectories(NamedTuple):
    """The episodes of a study or data set.

    Attributes:
        label: says how they were made, and whether people took part.
    """

    task: PairTask
    label: str
    episodes: Sequence[Trajectory]


def trajectory_of(robot: str, episode: "EpisodeResult") -> Trajectory:
    """The trajectory of a finished episode, with the rounding of a file.

    Args:
        robot: name of the robot.
    """
    assert episode.states is not None
    assert episode.actions is not None
    states = np.asarray(episode.states, np.float32)
    columns = {"robot": robot, **episode.to_json()}
    actions = np.asarray(episode.actions, np.float32)
    return Trajectory(states[:-1], actions, states[-1], episode.task.spec.record_hz, episode.scenario, columns)


def add_trajectories_flag(command: argparse.ArgumentParser, where: str) -> None:
    """Adds `--trajectories`.

    Args:
        where: place of the file, for the help.
    """
    text = f"also write the states and actions of all episodes, {where} (for `figures` and `behaviours`)"
    command.add_argument("--trajectories", action="store_true", help=text)


def trajectories_beside(result: Path) -> Path:
    """Name of the trajectories beside a result `NAME.json`."""
    return result.with_name(result.name.removesuffix(".json") + SUFFIX)


def write_result(
    path: Path, result: Mapping[str, Any], task: PairTask, label: str, episodes: Iterable[NamedEpisode] | None = None
) -> None:
    """Writes a result (JSON) and, of given episodes, the trajectories beside it; existing files are replaced.

    The trajectories of an earlier result are removed, also by a result without any. A process that is killed in the
    meantime leaves the earlier result, or trajectories alone, but no result beside trajectories of other episodes.

    Args:
        label, episodes: see `write_trajectories`.
    """
    beside = trajectories_beside(path)
    if episodes is None:
        beside.unlink(missing_ok=True)
        replace_json(path, result, indent=1)
        return
    with replacements([beside, path]) as (trajectories, document):
        _write(trajectories, task, label, episodes)
        document.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        path.unlink(missing_ok=True)


def write_trajectories(path: Path, task: PairTask, label: str, episodes: Iterable[NamedEpisode]) -> None:
    """Writes trajectories: float32 states and actions at the task's rate, and per episode its scenario and row.

    Args:
        path: replaced if it exists.
        label: see `Trajectories`.
        episodes: name of the robot and episode.
    """
    with replacement(path) as partial:
        _write(partial, task, label, episodes)


def _write(path: Path, task: PairTask, label: str, episodes: Iterable[NamedEpisode]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns: dict[str, list[Any]] = {name: [] for name in ("episode", "state", "action")}
    rows = []
    for index, named in enumerate(episodes):
        each = trajectory_of(*named)
        columns["episode"].append(np.full(len(each.every_state), index, np.int32))
        columns["state"].append(each.every_state)
        # The final state has no action.
        columns["action"].append(np.pad(each.actions, ((0, 1), (0, 0))))
        rows.append({"scenario": each.scenario.to_json(), "columns": each.columns})
    arrays = {name: np.concatenate(parts) for name, parts in columns.items()}
    table = pa.table(
        {
            "episode": arrays["episode"],
            **{
                name: pa.FixedSizeListArray.from_arrays(pa.array(arrays[name].reshape(-1)), arrays[name].shape[1])
                for name in ("state", "action")
            },
        }
    )
    described = {"task": task.spec.name, "label": label, "fps": task.spec.record_hz, "episodes": rows}
    pq.write_table(table.replace_schema_metadata({_KEY: json.dumps(described)}), path, compression="zstd")


def read_trajectories(path: Path) -> Trajectories:
    """Reads trajectories.

    Args:
        path: the file, or the result (`NAME.json`) beside which it is.

    Raises:
        FileFormatError: the file does not exist, or has no trajectories of an installed task.
    """
    import pyarrow.parquet as pq

    from copolicy.dataset.lerobot_folder.tables import DAMAGED, vectors

    path = trajectories_beside(path) if path.suffix == ".json" else path
    if not path.is_file():
        raise FileFormatError(path, _EXPECTED, "no such file")
    try:
        table = pq.read_table(path)
        described = json.loads((table.schema.metadata or {})[_KEY])
        task = get_task(described["task"])
        index = table["episode"].to_numpy()
        states, actions = (
            vectors(table[name], width)
            for name, width in (("state", len(task.spec.state)), ("action", len(task.spec.joint_action)))
        )
        bounds = np.searchsorted(index, np.arange(len(described["episodes"]) + 1))
        return Trajectories(
            task,
            described["label"],
            [
                Trajectory(
                    states[start : end - 1],
                    actions[start : end - 1],
                    states[end - 1],
                    described["fps"],
                    task.scenario_of_json(row["scenario"]),
                    row["columns"],
                )
                for start, end, row in zip(bounds, bounds[1:], described["episodes"], strict=False)
            ],
        )
    except (*DAMAGED, KeyError, TypeError, IndexError, CopolicyError) as error:
        raise FileFormatError(path, _EXPECTED, f"{type(error).__name__}: {error}") from None


def demonstrations(path: str | Path, revision: str | None = None) -> Trajectories:
    """The episodes of a LeRobot data set of a pair task that are not excluded.

    Raises:
        CopolicyError: see `load_dataset`.
    """
    from copolicy.dataset import load_dataset

    data = load_dataset(path, revision)
    episodes = [
        Trajectory(episode.states, episode.actions, None, episode.fps, episode.scenario, episode.columns)
        for episode in data.episodes
        if not episode.columns.get("discarded")
    ]
    sources = sorted({str(episode.columns["source"]) for episode in episodes})
    return Trajectories(data.task, f"demonstrations, source: {', '.join(sources)}", episodes)
