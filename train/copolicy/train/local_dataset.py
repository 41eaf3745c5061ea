"""Looks at a local LeRobot data set before LeRobot does, which takes anything missing for a reason to download."""

import json
import logging
from pathlib import Path

import pyarrow.parquet as pq

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, RunError


def check_local_dataset(root: Path | str) -> None:
    """Checks that the files of a LeRobot v3 data set are there and complete.

    Raises:
        FileFormatError: no such folder, no `meta/info.json` of version 3, a Parquet file that is missing or broken, or
            another number of rows or episodes than `meta/info.json` says.
    """
    root = Path(root)
    info_path = root / "meta" / "info.json"
    if not root.is_dir():
        raise FileFormatError(root, "the folder of a LeRobot v3 data set", "no such folder")
    try:
        info = json.loads(info_path.read_text(encoding="utf-8"))
        version, frames, episodes = str(info["codebase_version"]), info["total_frames"], info["total_episodes"]
    except FileNotFoundError:
        raise FileFormatError(info_path, "a LeRobot v3 data set", "no such file") from None
    except (ValueError, KeyError, TypeError) as error:
        raise FileFormatError(info_path, "LeRobot's data set information", f"{type(error).__name__} {error}") from None
    if not version.startswith("v3."):
        raise FileFormatError(info_path, "LeRobot data set format v3", version)
    for folder, expected in ((root / "meta" / "episodes", episodes), (root / "data", frames)):
        found = _rows(folder)
        if found != expected:
            raise FileFormatError(folder, f"{expected} rows, as meta/info.json says", f"{found}")
    tasks = root / "meta" / "tasks.parquet"
    if not tasks.is_file():
        raise FileFormatError(tasks, "part of a LeRobot v3 data set", "no such file")


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


def _rows(folder: Path) -> int:
    rows = 0
    for path in sorted(folder.glob("*/*.parquet")):
        try:
            rows += pq.read_metadata(path).num_rows
        except (OSError, ValueError) as error:  # pyarrow's own errors are ValueErrors
            raise FileFormatError(path, "a complete Parquet file", str(error).splitlines()[0]) from None
    return rows
