"""Reads a folder of recordings, one MCAP file per episode, as `EpisodeData`."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..arrays import Array
from ..command_line.commands import progress
from ..episode import EPISODE_COLUMNS, Episode
from ..exceptions import CopolicyError, ForeignRecordingError
from ..features import ACTION, ENVIRONMENT_STATE, STATE
from ..files.listing import broken_links, distinct_files
from ..recording.reader import read_episode
from ..task import get_task
from .episode_data import COLUMN_TYPES, EpisodeData
from .finding import Finding


def read_recordings(root: Path) -> EpisodeData:
    """Reads every `*.mcap` below a folder; unreadable and unfinished files become findings."""
    paths = distinct_files(root, "*.mcap")
    episodes: list[Episode] = []
    labels: list[str] = []
    damage = [
        Finding(path.relative_to(root).as_posix(), "unfinished", None, None, "warning",
                "an unfinished recording; copolicy-collect recover makes it readable")
        for path in distinct_files(root, "*.mcap.part")
    ]  # fmt: skip
    damage += [
        Finding(path.relative_to(root).as_posix(), "check_sum", None, None, "error", "a link that leads nowhere")
        for path in broken_links(root)
    ]
    paths = [path for path in paths if path.exists()]
    for path in progress(paths, len(paths), "reading"):
        label = path.relative_to(root).as_posix()
        try:
            episode = read_episode(path)
        except CopolicyError as error:
            message = str(error).removeprefix(f"{path}: ")
            rule = "foreign" if isinstance(error, ForeignRecordingError) else "check_sum"
            damage.append(Finding(label, rule, None, None, "error", message))
            continue
        damage += unverified_findings(label, episode)
        if episodes and episode.task != episodes[0].task:
            message = f"a recording of the task {episode.task!r} beside those of {episodes[0].task!r}"
            damage.append(Finding(label, "foreign", None, None, "error", message))
        elif len(episode.actions):
            episodes.append(episode)
            labels.append(label)
        else:
            damage.append(Finding(label, "empty", 0, 1, "error", "a recording without a single step"))
    return data_of_recordings(root, labels, episodes, tuple(damage))


def unverified_findings(label: str, episode: Episode) -> list[Finding]:
    """Findings for the parts of a recording without a check sum, whose integrity cannot be verified."""
    return [Finding(label, "not_verified", None, None, "warning", note) for note in episode.notes]


def data_of_recordings(
    root: Path, labels: Sequence[str], episodes: Sequence[Episode], damage: tuple[Finding, ...] = ()
) -> EpisodeData:
    """`EpisodeData` of recordings in memory.

    Args:
        labels: names of the episodes in findings.
        episodes: episodes of one task with at least one step each.
    """
    task = get_task(episodes[0].task) if episodes else get_task()
    lengths = np.array([len(episode.actions) for episode in episodes], np.int64)
    columns = {
        name: np.array([getattr(episode.meta, name) for episode in episodes], COLUMN_TYPES[type_name])
        for name, type_name in EPISODE_COLUMNS.items()
    }
    frames: dict[str, Array] = {}
    final_states = None
    if episodes:
        scenarios = np.array([task.scenario_vector(episode.scenario) for episode in episodes])
        frames = {
            STATE: np.concatenate([episode.states for episode in episodes]),
            ACTION: np.concatenate([episode.actions for episode in episodes]),
            ENVIRONMENT_STATE: np.repeat(scenarios, lengths, axis=0),
        }
        final_states = np.array([episode.final_state for episode in episodes])
    return EpisodeData(
        root, "recordings", float(task.spec.record_hz), tuple(labels), {**columns, "length": lengths}, frames,
        np.arange(len(episodes)), np.cumsum(lengths) - lengths, final_states, damage=damage, task=task,
    )  # fmt: skip
