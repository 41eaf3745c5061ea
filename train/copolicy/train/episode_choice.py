"""A local data set before training: whether its files are complete, and which episodes a policy is trained on.

The episodes are those asked for, less those that the data set marks as excluded.
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

_MARK = "discarded"
_LOST = (
    "its episode columns were lost, as by LeRobot's delete_episodes; copolicy-dataset restores them from the "
    "recordings or an earlier version (copolicy-dataset amend --help)"
)


def check_local_dataset(root: Path | str) -> None:
    """Checks that the files of a LeRobot v3 data set are there and complete, whatever its task.

    Raises:
        FileFormatError: no such folder, no `meta/info.json` of version 3, a Parquet file that is missing or broken,
            another number of rows or episodes than `meta/info.json` says, or an episode whose file is not named.
    """
    root = Path(root)
    if not root.is_dir():
        raise FileFormatError(root, "the folder of a LeRobot v3 data set", "no such folder")
    # Training mends statistics that an excluded episode spoiled, and refuses others.
    require_loadable(root, finite_statistics=False)


def training_episodes(episodes: list[int] | None, total: int, discarded: list[bool]) -> list[int] | None:
    """The episodes to train on: those asked for, without the discarded ones.

    Args:
        episodes: asked for; None for all.
        total: episodes of the data set.
        discarded: their column `discarded`; empty if the data set has none.

    Returns:
        None where that is simply all of them.

    Raises:
        InvalidValueError: an episode that is not there.
        RunError: none is left.
    """
    asked = list(range(total)) if episodes is None else episodes
    missing = [episode for episode in asked if not 0 <= episode < total]
    if missing:
        raise InvalidValueError("dataset.episodes", f"0 to {total - 1}", missing[0])
    kept = [episode for episode in asked if not (discarded and discarded[episode])]
    if not kept:
        raise RunError(f"dataset.episodes: all of the {len(asked)} episodes to train on are marked as discarded")
    if len(kept) == len(asked):
        return episodes
    left_out = sorted(set(asked) - set(kept))
    logging.info("Leaving out %d discarded of %d episodes: %s", len(left_out), len(asked), left_out)
    return kept


def excluded_episodes(meta: Any) -> frozenset[int]:
    """The episodes that the column `discarded` of a data set marks; an empty value marks none.

    Args:
        meta: LeRobot's metadata of the data set.

    Raises:
        RunError: the column holds something else than true, false or nothing.
    """
    episodes = meta.episodes
    if episodes is None or _MARK not in episodes.column_names:
        return frozenset()
    pairs = list(zip(episodes["episode_index"], episodes[_MARK], strict=True))
    other = next((value for _, value in pairs if not (value is None or isinstance(value, bool))), None)
    if other is not None:
        raise RunError(f"{meta.root}: expected true or false in the episode column {_MARK}, found {other!r}")
    return frozenset(int(episode) for episode, marked in pairs if marked)


def require_episode_columns(meta: Any, named: bool) -> None:
    """Refuses a data set of copolicy that does not say any more which episodes are excluded.

    Args:
        meta: LeRobot's metadata of the data set.
        named: the user named the episodes to train on, and so has chosen.

    Raises:
        RunError: the column is gone.
    """
    episodes = meta.episodes
    if named or episodes is None or _MARK in episodes.column_names or not _is_ours(meta):
        return
    raise RunError(
        f"{meta.root}: expected the episode column {_MARK}, which says what to leave out, found none: {_LOST}; or name "
        "the episodes to train on: --dataset.episodes=[0,1,...]"
    )


def _is_ours(meta: Any) -> bool:
    """A conversion of ours left a mark that LeRobot's tools keep, or a document that they do not touch."""
    marked = is_copolicy_info({"robot_type": meta.robot_type, "features": dict(meta.features)})
    return marked or any((Path(meta.root) / "meta").glob("copolicy*.json"))


def chosen_episodes(meta: Any, asked: Sequence[int] | None) -> list[int]:
    """The episodes that a new run trains on, in the order asked for.

    Args:
        meta: LeRobot's metadata of the data set.
        asked: as `--dataset.episodes` says; None for all.

    Raises:
        InvalidValueError: an episode that is not there.
        RunError: none is left, or the data set has lost the column that tells.
    """
    if not meta.total_episodes:
        raise RunError(f"{meta.root}: expected a data set with episodes, found an empty one")
    require_episode_columns(meta, named=asked is not None)
    excluded, total = excluded_episodes(meta), meta.total_episodes
    chosen = training_episodes(None if asked is None else list(asked), total, [k in excluded for k in range(total)])
    return list(range(total)) if chosen is None else chosen


def resumed_episodes(meta: Any, asked: Sequence[int] | None, began: Sequence[int] | None) -> list[int]:
    """The episodes that a resumed run goes on with: those that it began with, less what was excluded since.

    Args:
        meta: LeRobot's metadata of the data set.
        asked: of the run's settings, which `--dataset.episodes` may have changed.
        began: what the checkpoint says; None where it does not say, as before every run recorded them.

    Raises:
        InvalidValueError: an episode that is not there any more.
        RunError: none is left, or the data set has lost the column that tells.
    """
    changed = asked is not None and list(asked) != list(began or ())
    require_episode_columns(meta, named=changed)
    excluded, total = excluded_episodes(meta), meta.total_episodes
    source = list(range(total)) if asked is None else list(asked)
    chosen = training_episodes(source, total, [k in excluded for k in range(total)]) or source
    since = sorted(set(source) - set(chosen))
    if changed:
        origin = "that --dataset.episodes names"
    elif asked is None:
        origin = "of the data set (the checkpoint does not say which ones the run began with)"
    else:
        origin = "that the run began with"
    left_out = f"; excluded since: {since}" if since else ""
    logging.info("Resuming with %d of the %d episodes %s%s", len(chosen), len(source), origin, left_out)
    return chosen


def recorded_episodes(checkpoint: Path) -> list[int] | None:
    """The episodes that the checkpoint of a run says it trained on; None where it does not say.

    Raises:
        FileFormatError: its `train_config.json` cannot be read.
    """
    path = checkpoint / "pretrained_model" / "train_config.json"
    settings = read_json(path, TrainingDocument, "the settings of a training")
    return (settings.get("dataset") or {}).get("episodes")
