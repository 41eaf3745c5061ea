"""What a data set holds, apart from how its files are cut, compressed and ordered; and the hash of it.

The content hash `copolicy-content-1:sha256:HEX` is the sha256 of `canonical.encode` of a dict with

* `format`: `copolicy-content-1`
* `fps`, `robot_type`, `features` (the table of `meta/info.json`), `tasks` (the sentences, sorted)
* `episodes`: the digest of each episode in order, the sha256 of `canonical.encode` of its length, its episode columns
  (exclusions are among them) and the digests of its features (`frames.frame_digests`, `videos.video_digest`)

Left out on purpose: where things lie (chunk, file, row group, compression, order of columns and of rows, the running
numbers of frames and episodes), what is computed from the frames (statistics), and what describes (the card, the
figures, `meta/copolicy.json`). A manifest covers those.
"""

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..episode import EPISODE_COLUMNS
from ..exceptions import FileFormatError
from . import parquet
from .canonical import digest
from .frames import frame_digests
from .videos import video_digest

FORMAT = "copolicy-content-1"
"""Version of the algorithm; another one gives another prefix."""

_LAYOUT = ("data/", "meta/episodes/", "videos/", "stats/")
_POSITION = {"episode_index", "length", "dataset_from_index", "dataset_to_index"}
_DIGITS = 16  # of a column's digest; it is compared, never trusted


@dataclass(frozen=True)
class EpisodeContent:
    """One episode.

    Attributes:
        digest: sha256 over everything in it.
        frames: its length.
        features: digest of each feature's values, shortened.
        columns: digest of each episode column, shortened.
    """

    episode_uuid: str
    digest: str
    frames: int
    features: dict[str, str]
    columns: dict[str, str]


@dataclass(frozen=True)
class Content:
    """Everything that two data sets are compared by."""

    fps: float
    robot_type: str | None
    features: dict[str, Any]
    tasks: list[str]
    episodes: tuple[EpisodeContent, ...]

    @property
    def hash(self) -> str:
        """The content hash with its prefix."""
        fields = {
            "format": FORMAT,
            "fps": float(self.fps),
            "robot_type": self.robot_type,
            "features": self.features,
            "tasks": self.tasks,
            "episodes": [episode.digest for episode in self.episodes],
        }
        return f"{FORMAT}:sha256:{digest(fields)}"

    def to_json(self) -> dict[str, Any]:
        """For the record of a release."""
        return asdict(self)

    @classmethod
    def from_json(cls, fields: dict[str, Any]) -> "Content":
        """The inverse of `to_json`.

        Raises:
            TypeError, KeyError: other fields.
        """
        episodes = tuple(EpisodeContent(**episode) for episode in fields["episodes"])
        return cls(**{**fields, "episodes": episodes})


def read_content(root: Path) -> Content:
    """Reads a LeRobot v3 data set folder.

    Raises:
        FileFormatError: no such data set, one without `episode_uuid`, or one that contradicts itself.
        MissingExtraError: pyarrow is not installed.
    """
    info = _read_info(root)
    rows = _read_episodes(root)
    tasks = _read_tasks(root)
    frames = frame_digests(root, info, [row["length"] for row in rows], tasks)
    episodes = tuple(_episode(root, info, row, features) for row, features in zip(rows, frames, strict=True))
    return Content(
        float(info["fps"]),
        info.get("robot_type"),
        info["features"],
        sorted(tasks.values()),
        episodes,
    )


def _episode(root: Path, info: dict, row: dict[str, Any], features: dict[str, str]) -> EpisodeContent:
    for name, feature in info["features"].items():
        if feature["dtype"] == "video":
            place = {part: row[f"videos/{name}/{part}"] for part in ("chunk_index", "file_index")}
            path = root / info["video_path"].format(video_key=name, **place)
            start, end = (row[f"videos/{name}/{part}_timestamp"] for part in ("from", "to"))
            features[name] = video_digest(path, start, end, info["fps"])
    columns = {
        name: digest(value) for name, value in row.items() if name not in _POSITION and not name.startswith(_LAYOUT)
    }
    return EpisodeContent(
        row["episode_uuid"],
        digest({"frames": row["length"], "features": features, "columns": columns}),
        row["length"],
        {name: text[:_DIGITS] for name, text in sorted(features.items())},
        {name: text[:_DIGITS] for name, text in sorted(columns.items())},
    )


def _read_info(root: Path) -> dict[str, Any]:
    path = root / "meta" / "info.json"
    if not path.is_file():
        raise FileFormatError(root, "a LeRobot v3 data set with meta/info.json", "none")
    info = _read_json(path)
    missing = [name for name in ("codebase_version", "fps", "features") if name not in info]
    if missing:
        raise FileFormatError(path, "LeRobot's info", f"none of {', '.join(missing)}")
    if not str(info["codebase_version"]).startswith("v3"):
        raise FileFormatError(path, "codebase_version v3.x", str(info["codebase_version"]))
    return info


def _read_episodes(root: Path) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for path in parquet.files_under(root, "meta/episodes"):
        names = [name for name in parquet.column_names(path) if not name.startswith("stats/")]
        missing = [name for name in ("episode_index", "length", "episode_uuid") if name not in names]
        if missing:
            raise FileFormatError(path, "the episode columns of copolicy", f"none named {', '.join(missing)}")
        rows += parquet.read_rows(path, names)
    rows.sort(key=lambda row: row["episode_index"])
    if [row["episode_index"] for row in rows] != list(range(len(rows))):
        raise FileFormatError(root / "meta" / "episodes", f"episodes 0 to {len(rows) - 1}, each once", "others")
    uuids = [row["episode_uuid"] for row in rows]
    if len(set(uuids)) != len(uuids) or not all(uuids):
        raise FileFormatError(root / "meta" / "episodes", "an episode_uuid of its own for each episode", "others")
    # A file of a merge may lack a column that another has; LeRobot reads it as null.
    names = {name: None for row in rows for name in row}
    return [{name: _known(name, row.get(name)) for name in names} for row in rows]


def _known(name: str, value: Any) -> Any:
    """A number that is not known is null in a table, NaN in those of earlier versions: one content."""
    return math.nan if value is None and EPISODE_COLUMNS.get(name) == "float" else value


def _read_tasks(root: Path) -> dict[int, str]:
    path = root / "meta" / "tasks.parquet"
    if not path.is_file():
        raise FileFormatError(root, "a LeRobot v3 data set with meta/tasks.parquet", "none")
    # pandas calls an index without a name so, and LeRobot before 0.4 left it without one.
    names = [name for name in parquet.column_names(path) if name in ("task", "__index_level_0__")]
    if "task_index" not in parquet.column_names(path) or not names:
        raise FileFormatError(path, "columns task_index and task", "others")
    return {row["task_index"]: row[names[0]] for row in parquet.read_rows(path, ["task_index", names[0]])}


def _read_json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, OSError) as error:
        raise FileFormatError(path, "JSON", str(error)) from None
