"""LeRobot's aggregation of data sets, and what it loses put back."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from copolicy.dataset.edit.subset.numbered_files import numbered_files
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.meta_files import EPISODES_FOLDER, INFO_FILE, STATS_FILE, TASKS_FILE
from copolicy.dataset.lerobot_folder.info import read_info
from copolicy.dataset.lerobot_folder.tables import read_parquet

from ..lerobot.joined_sets import join_data_sets
from ..lerobot.shifted_tables import write_like


def aggregate(roots: Sequence[Path], repo_id: str, target: Path, cache: Path) -> dict[str, Any]:
    """One data set out of several with the same features, in their order.

    LeRobot joins them, one file of frames (and of video) a part: to pack thousands of parts into one file it would read
    and write that file thousands of times. What else it does to them is undone: columns change
    their type, video features lose what names their encoder.

    Args:
        target: a new folder.
        cache: a folder for its own use; it goes away at the end.

    Returns:
        `meta/info.json` of the result.

    Raises:
        FileFormatError: a part is not complete. LeRobot would look for it on the Hub.
    """
    for root in roots:
        for name in (INFO_FILE, STATS_FILE, TASKS_FILE, EPISODES_FOLDER, "data"):
            if not (root / name).exists():
                raise FileFormatError(root, f"a complete data set with {name}", "none; delete the shard's folder")
    join_data_sets(roots, repo_id, target, cache, concatenate_data=False)
    info = read_info(target)
    info["features"] = read_info(roots[0])["features"]
    (target / INFO_FILE).write_text(json.dumps(info, indent=4, ensure_ascii=False), encoding="utf-8")
    example = next(iter(numbered_files(roots[0] / EPISODES_FOLDER).values()))
    for path in numbered_files(target / EPISODES_FOLDER).values():
        write_like(read_parquet(path), example, path)
    return info
