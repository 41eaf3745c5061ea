"""Checks the files of a local data set before training, and selects the episodes to train on.

These are the requested episodes, without those that the data set marks as excluded.
"""

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, RunError
from copolicy.dataset.files.json_file import read_json
from copolicy.dataset.lerobot_folder.info import is_copolicy_info
from copolicy.dataset.lerobot_folder.loading import require_loadable
from copolicy.dataset.policies.documents import TrainingDocument

_DISCARDED = "discarded"
_REPAIR = (
    "its episode columns were lost, as by LeRobot's delete_episodes; copolicy-dataset restores them from the "
    "recordings or an earlier version (copolicy-dataset amend --help)"
)


def check_local_dataset(root: Path | str) -> None:
    """Checks that the files of a LeRobot v3 data set exist and are complete, for any task.

    Raises:
        FileFormatError: the folder or a version 3 `meta/info.json` does not exist, a Parquet file is missing or
            damaged, rows or episodes are not as many as in `meta/info.json`, or an episode has no file name.
    """
    root = Path(root)
    if not root.is_dir():
        raise FileFormatError(root, "the folder of a LeRobot v3 data set", "no such folder")
    # Statistics are checked later: training replaces those in which only excluded episodes are not finite.
    require_loadable(root, finite_statistics=False)


def training_episodes(episodes: list[int] | None, total: int, discarded: list[bool]) -> list[int] | None:
    """The episodes to train on: the requested ones without the discarded ones.

    Args:
        episodes: requested episodes; None for all.
        total: number of episodes of the data set.
        discarded: the column `discarded` of all episodes; empty if the data set does not have it.

    Returns:
        None if `episodes` is None and no episode is discarded.

    Raises:
        InvalidValueError: a requested episode does not exist.
        RunError: all requested episodes are discarded.
    """
    requested = list(range(total)) if episodes is None else episodes
    missing = [episode for episode in requested if not 0 <= episode < total]
    if missing:
        raise InvalidValueError("dataset.episodes", f"0 to {total - 1}", missing[0])
    selected = [episode for episode in requested if not (discarded and discarded[episode])]
    if not selected:
        raise RunError(f"dataset.episodes: all of the {len(requested)} episodes to train on are marked as discarded")
    if len(selected) == len(requested):
        return episodes
    left_out = sorted(set(requested) - set(selected))
    logging.info("Leaving out %d discarded of %d episodes: %s", len(left_out), len(requested), left_out)
    return selected


def excluded_episodes(meta: Any) -> frozenset[int]:
    """The episodes that the column `discarded` of a data set marks; an empty value counts as false.

    Args:
        meta: LeRobot's metadata of the data set.

    Raises:
        RunError: the column has a value other than true, false or empty.
    """
    episodes = meta.episodes
    if episodes is None or _DISCARDED not in episodes.column_names:
        return frozenset()
    pairs = list(zip(episodes["episode_index"], episodes[_DISCARDED], strict=True))
    invalid = next((value for _, value in pairs if not (value is None or isinstance(value, bool))), None)
    if invalid is not None:
        raise RunError(f"{meta.root}: expected true or false in the episode column {_DISCARDED}, found {invalid!r}")
    return frozenset(int(episode) for episode, discarded in pairs if discarded)


def require_episode_columns(meta: Any, requested: bool) -> None:
    """Refuses a data set of copolicy that has lost the column of excluded episodes.

    Args:
        meta: LeRobot's metadata of the data set.
        requested: the user named the episodes to train on, so that the column is not needed.

    Raises:
        RunError: the column is missing.
    """
    episodes = meta.episodes
    if requested or episodes is None or _DISCARDED in episodes.column_names or not _is_ours(meta):
        return
    raise RunError(
        f"{meta.root}: expected the episode column {_DISCARDED}, which marks episodes to leave out, found none: "
        f"{_REPAIR}; or name the episodes to train on: --dataset.episodes=[0,1,...]"
    )


def _is_ours(meta: Any) -> bool:
    """Whether a data set has copolicy's robot type or features, which LeRobot's tools keep, or a file of copolicy's."""
    has_features = is_copolicy_info({"robot_type": meta.robot_type, "features": dict(meta.features)})
    return has_features or any((Path(meta.root) / "meta").glob("copolicy*.json"))


def selected_episodes(meta: Any, requested: Sequence[int] | None) -> list[int]:
    """The episodes that a new run trains on, in the requested order.

    Args:
        meta: LeRobot's metadata of the data set.
        requested: episodes of `--dataset.episodes`; None for all.

    Raises:
        InvalidValueError: a requested episode does not exist.
        RunError: all are excluded, or the data set has lost the column of excluded episodes.
    """
    if not meta.total_episodes:
        raise RunError(f"{meta.root}: expected a data set with episodes, found an empty one")
    require_episode_columns(meta, requested is not None)
    excluded, total = excluded_episodes(meta), meta.total_episodes
    source = list(range(total)) if requested is None else list(requested)
    return training_episodes(source, total, [k in excluded for k in range(total)]) or source


def resumed_episodes(meta: Any, requested: Sequence[int] | None, recorded: Sequence[int] | None) -> list[int]:
    """The episodes of a resumed run: those of the run so far, without episodes excluded since.

    Args:
        meta: LeRobot's metadata of the data set.
        requested: episodes of the run's settings, which `--dataset.episodes` may have changed.
        recorded: episodes of the checkpoint; None for a checkpoint that does not record them.

    Raises:
        InvalidValueError: an episode does not exist any more.
        RunError: all are excluded, or the data set has lost the column of excluded episodes.
    """
    changed = requested is not None and list(requested) != list(recorded or ())
    require_episode_columns(meta, changed)
    excluded, total = excluded_episodes(meta), meta.total_episodes
    source = list(range(total)) if requested is None else list(requested)
    selected = training_episodes(source, total, [k in excluded for k in range(total)]) or source
    since = sorted(set(source) - set(selected))
    if changed:
        origin = "of --dataset.episodes"
    elif requested is None:
        origin = "of the data set (the checkpoint does not record those of the run)"
    else:
        origin = "of the run"
    left_out = f"; excluded since: {since}" if since else ""
    logging.info("Resuming with %d of the %d episodes %s%s", len(selected), len(source), origin, left_out)
    return selected


def recorded_episodes(checkpoint: Path) -> list[int] | None:
    """The episodes that a checkpoint of a run was trained on; None if it does not record them.

    Raises:
        FileFormatError: its `train_config.json` cannot be read.
    """
    path = checkpoint / "pretrained_model" / "train_config.json"
    settings = read_json(path, TrainingDocument, "the settings of a training")
    return (settings.get("dataset") or {}).get("episodes")
