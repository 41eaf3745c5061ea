"""What a data set says of itself: everything a card may state, read from the folder and from nowhere else."""

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copolicy.dataset.episode import EPISODE_COLUMNS, LATER_COLUMNS, LATER_DEFAULTS
from copolicy.dataset.exceptions import FileFormatError, MissingExtraError
from copolicy.dataset.files import visible_files

try:
    import pyarrow as pa
    import pyarrow.parquet as parquet
except ModuleNotFoundError:
    raise MissingExtraError("pyarrow") from None


@dataclass(frozen=True)
class DatasetFacts:
    """The metadata of a LeRobot v3 data set and its episodes.

    Attributes:
        info: `meta/info.json`.
        episodes: one dict an episode with its episode columns and `length` (frames).
    """

    root: Path
    info: dict[str, Any]
    episodes: tuple[dict[str, Any], ...]

    @classmethod
    def read(cls, root: Path) -> "DatasetFacts":
        """Reads a data set folder.

        Raises:
            FileFormatError: no LeRobot v3 data set, one without the episode columns, or one that contradicts itself.
        """
        path = root / "meta" / "info.json"
        if not path.is_file():
            raise FileFormatError(root, "a LeRobot v3 data set with meta/info.json", "none")
        try:
            info = json.loads(path.read_text(encoding="utf-8"))
            version, count, frames = info["codebase_version"], info["total_episodes"], info["total_frames"]
        except (ValueError, KeyError, TypeError) as error:
            raise FileFormatError(path, "LeRobot's info as JSON", f"{type(error).__name__} {error}") from None
        if not str(version).startswith("v3"):
            raise FileFormatError(path, "codebase_version v3.x", str(version))
        episodes = _read_episodes(root)
        if len(episodes) != count or sum(episode["length"] for episode in episodes) != frames:
            found = f"{len(episodes)} episodes with {sum(episode['length'] for episode in episodes)} frames"
            raise FileFormatError(path, f"{count} episodes with {frames} frames in meta/episodes", found)
        return cls(root, info, episodes)

    def counts(self, column: str) -> dict[str, int]:
        """How many episodes have each value of a column, most frequent first."""
        counter = Counter(str(episode[column]) for episode in self.episodes)
        return dict(sorted(counter.items(), key=lambda item: (-item[1], item[0])))

    def values(self, column: str) -> list[str]:
        """Distinct non-empty values of a column, sorted."""
        return sorted({str(episode[column]) for episode in self.episodes} - {""})

    @property
    def seconds(self) -> float:
        """Recorded time in all, s."""
        return float(sum(episode["duration_s"] for episode in self.episodes))

    @property
    def successes(self) -> int:
        """Episodes that reached the goal."""
        return sum(bool(episode["success"]) for episode in self.episodes)


def stored_columns(root: Path) -> set[str]:
    """The columns of meta/episodes; a data set of an earlier version lacks some of `LATER_COLUMNS`."""
    files = visible_files(root / "meta" / "episodes", "*.parquet")
    return {name for path in files for name in parquet.read_schema(path).names}


def _read_episodes(root: Path) -> tuple[dict[str, Any], ...]:
    files = visible_files(root / "meta" / "episodes", "*.parquet")
    if not files:
        raise FileFormatError(root, "episode metadata under meta/episodes", "no parquet file")
    rows: list[dict[str, Any]] = []
    for path in files:
        try:
            names = parquet.read_schema(path).names
            missing = [name for name in EPISODE_COLUMNS if name not in names and name not in LATER_COLUMNS]
            if missing:
                raise FileFormatError(path, "the episode columns of copolicy", f"none named {', '.join(missing)}")
            wanted = ["episode_index", "length", *(name for name in EPISODE_COLUMNS if name in names)]
            rows += [_completed(row) for row in parquet.read_table(path, columns=wanted).to_pylist()]
        except (pa.ArrowInvalid, OSError) as error:
            raise FileFormatError(path, "a complete parquet file", str(error).splitlines()[0]) from None
    return tuple(sorted(rows, key=lambda row: row["episode_index"]))


def _completed(row: dict[str, Any]) -> dict[str, Any]:
    return row | {name: default for name, default in LATER_DEFAULTS.items() if row.get(name) is None}
