"""Reads the content of a data set and its hash, independent of how files are split, compressed and ordered.

The content hash `copolicy-content-1:sha256:HEX` is the sha256 of `digests.encode` of a dict with

* `format`: `copolicy-content-1`
* `fps`, `robot_type`, `features` (the dict in `meta/info.json`), `tasks` (the sentences, sorted)
* `episodes`: the digest of each episode in order, the sha256 of `digests.encode` of its length, its episode columns
  (including exclusions) and the digests of its features (`frame_digests.frame_digests` and `video_digest`)

An episode column of later versions (`UNHASHED_DEFAULTS`) counts only if its value is not the default, so that the
hash is the same with and without the column.

The hash excludes the storage layout (chunk, file, row group, compression, order of columns and rows, indices of
frames and episodes), values computed from the frames (statistics), and descriptions (the card, the figures,
`meta/copolicy.json`). The manifest covers those.
"""

import math
from collections import Counter
from pathlib import Path
from typing import Any

from ..episode import EPISODE_COLUMNS, UNHASHED_DEFAULTS, UNKNOWN_VALUES
from ..exceptions import FileFormatError
from ..files.meta_files import EPISODES_FOLDER
from ..lerobot_folder.folder import LeRobotFolder
from ..lerobot_folder.references import read_tasks, video_span
from .digests import Content, EpisodeContent, digest
from .frame_digests import frame_digests, video_digest

_STORAGE_PREFIXES = ("data/", "meta/episodes/", "videos/", "stats/")
_POSITION_COLUMNS = {"episode_index", "length", "dataset_from_index", "dataset_to_index"}
_DIGEST_LENGTH = 16  # enough to compare columns; security rests on the full digest


def read_content(root: Path) -> Content:
    """Reads the content of a LeRobot v3 data set folder.

    Raises:
        FileFormatError: no such data set, one without `episode_uuid`, or an inconsistent one.
    """
    folder = LeRobotFolder.open(root)
    info, rows = folder.info, _read_episodes(folder)
    tasks = read_tasks(root)
    frames = frame_digests(folder, tasks)
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
            path, start, end = video_span(root, info, row, name)
            features[name] = video_digest(path, start, end, info["fps"])
    columns = {
        name: digest(value)
        for name, value in row.items()
        if name not in _POSITION_COLUMNS
        and not name.startswith(_STORAGE_PREFIXES)
        and (name not in UNHASHED_DEFAULTS or value not in (None, UNKNOWN_VALUES[name]))
    }
    return EpisodeContent(
        row["episode_uuid"],
        digest({"frames": row["length"], "features": features, "columns": columns}),
        row["length"],
        {name: text[:_DIGEST_LENGTH] for name, text in sorted(features.items())},
        {name: text[:_DIGEST_LENGTH] for name, text in sorted(columns.items())},
    )


def _read_episodes(folder: LeRobotFolder) -> list[dict[str, Any]]:
    root = folder.root
    uuids = Counter(row["episode_uuid"] for row in folder.rows(("episode_uuid",)))
    uuid, episodes = uuids.most_common(1)[0]
    if episodes > 1 or "" in uuids:
        found = f"{episodes} with {uuid!r}" if episodes > 1 else "an episode without one"
        raise FileFormatError(root / EPISODES_FOLDER, "a unique episode_uuid for each episode", found)
    # After a merge a file may lack a column that another file has; LeRobot reads it as null.
    return [{name: _null_as_nan(name, value) for name, value in row.items()} for row in folder.episodes.to_pylist()]


def _null_as_nan(name: str, value: Any) -> Any:
    """An unknown number is null, in data sets of earlier versions NaN; both are hashed as NaN."""
    return math.nan if value is None and EPISODE_COLUMNS.get(name) == "float" else value
