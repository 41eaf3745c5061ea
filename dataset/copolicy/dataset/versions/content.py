"""What a data set holds, apart from how its files are cut, compressed and ordered; and the hash of it.

The content hash `copolicy-content-1:sha256:HEX` is the sha256 of `canonical.encode` of a dict with

* `format`: `copolicy-content-1`
* `fps`, `robot_type`, `features` (the table of `meta/info.json`), `tasks` (the sentences, sorted)
* `episodes`: the digest of each episode in order, the sha256 of `canonical.encode` of its length, its episode columns
  (exclusions are among them) and the digests of its features (`frames.frame_digests`, `videos.video_digest`)

An episode column of later versions (`UNHASHED_DEFAULTS`) counts only where it says something, so that a data set has
one hash with and without it.

Left out on purpose: where things lie (chunk, file, row group, compression, order of columns and of rows, the running
numbers of frames and episodes), what is computed from the frames (statistics), and what describes (the card, the
figures, `meta/copolicy.json`). A manifest covers those.
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
from .frames import frame_digests, video_digest

_LAYOUT = ("data/", "meta/episodes/", "videos/", "stats/")
_POSITION = {"episode_index", "length", "dataset_from_index", "dataset_to_index"}
_DIGITS = 16  # of a column's digest; it is compared, never trusted


def read_content(root: Path) -> Content:
    """Reads a LeRobot v3 data set folder.

    Raises:
        FileFormatError: no such data set, one without `episode_uuid`, or one that contradicts itself.
        MissingExtraError: pyarrow is not installed.
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
        if name not in _POSITION
        and not name.startswith(_LAYOUT)
        and (name not in UNHASHED_DEFAULTS or value not in (None, UNKNOWN_VALUES[name]))
    }
    return EpisodeContent(
        row["episode_uuid"],
        digest({"frames": row["length"], "features": features, "columns": columns}),
        row["length"],
        {name: text[:_DIGITS] for name, text in sorted(features.items())},
        {name: text[:_DIGITS] for name, text in sorted(columns.items())},
    )


def _read_episodes(folder: LeRobotFolder) -> list[dict[str, Any]]:
    root = folder.root
    uuids = Counter(row["episode_uuid"] for row in folder.rows(("episode_uuid",)))
    uuid, episodes = uuids.most_common(1)[0]
    if episodes > 1 or "" in uuids:
        found = f"{episodes} with {uuid!r}" if episodes > 1 else "one with none"
        raise FileFormatError(root / EPISODES_FOLDER, "an episode_uuid of its own for each episode", found)
    # A file of a merge may lack a column that another has; LeRobot reads it as null.
    return [{name: _known(name, value) for name, value in row.items()} for row in folder.episodes.to_pylist()]


def _known(name: str, value: Any) -> Any:
    """A number that is not known is null in a table, NaN in those of earlier versions: one content."""
    return math.nan if value is None and EPISODE_COLUMNS.get(name) == "float" else value
