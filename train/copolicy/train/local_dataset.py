"""Looks at a local LeRobot data set before LeRobot does, which takes anything missing for a reason to download."""

import logging
from pathlib import Path

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, RunError
from copolicy.dataset.lerobot_folder.loading import require_loadable


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
