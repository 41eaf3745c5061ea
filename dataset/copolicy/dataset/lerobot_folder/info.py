"""Reads `meta/info.json` of a LeRobot v3 data set and describes a folder without one."""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NotRequired, TypedDict

from ..exceptions import FileFormatError
from ..files.file_kinds import describe_path
from ..files.json_file import read_json
from ..files.listing import visible_files
from ..files.meta_files import EPISODES_FOLDER, INFO_FILE
from ..task import TABLE, PairTask, get_task

_ROBOT_TYPE_PREFIX = "copolicy"  # of data sets that copolicy-convert writes
_DESCRIPTION = "LeRobot's data set information"


def robot_type(task: str) -> str:
    """The robot type in `meta/info.json` of data sets of a task written by `copolicy-convert`.

    LeRobot's tools keep it and refuse to merge data sets with different robot types.
    """
    return f"{_ROBOT_TYPE_PREFIX}_{task}"


def task_name(info: Mapping[str, Any]) -> str:
    """Name of the task of a data set, installed or not; `table` if its robot type names no task."""
    prefix, _, name = str(info.get("robot_type") or "").partition("_")
    return name if prefix == _ROBOT_TYPE_PREFIX and name else TABLE


def task_of(info: Mapping[str, Any]) -> PairTask:
    """Returns the task of a data set.

    Raises:
        UnknownNameError: the task is not installed.
    """
    return get_task(task_name(info))


class Feature(TypedDict):
    """A column of the frames, or a video."""

    dtype: str
    shape: list[int]
    names: NotRequired[Any]


class Info(TypedDict):
    """The entries that LeRobot or copolicy reads; other keys are kept."""

    codebase_version: str
    fps: int | float
    features: dict[str, Feature]
    total_episodes: int
    total_frames: int
    total_tasks: NotRequired[int]
    chunks_size: NotRequired[int]
    data_files_size_in_mb: NotRequired[int | float]
    video_files_size_in_mb: NotRequired[int | float]
    data_path: NotRequired[str | None]
    video_path: NotRequired[str | None]
    robot_type: NotRequired[str | None]
    splits: NotRequired[dict[str, str] | None]


class _Version(TypedDict):
    codebase_version: NotRequired[str]


def read_info(root: Path) -> dict[str, Any]:
    """Reads `meta/info.json` and checks the types of its entries.

    Raises:
        FileFormatError: no such folder, not a data set, another version of the format, or an entry that is missing or
            of another type.
    """
    path = root / INFO_FILE
    if not path.is_file():
        raise FileFormatError(root, "a LeRobot v3 data set with meta/info.json", _describe_folder(root))
    version = read_json(path, _Version, _DESCRIPTION).get("codebase_version")
    if version is not None and not version.startswith("v3."):
        raise FileFormatError(path, "codebase_version v3.x", _describe_version(version))
    info: dict[str, Any] = dict(read_json(path, Info, _DESCRIPTION))
    if not (math.isfinite(info["fps"]) and info["fps"] > 0):
        raise FileFormatError(path, f"{_DESCRIPTION}, with a positive fps", repr(info["fps"]))
    for name in ("chunks_size", "data_files_size_in_mb", "video_files_size_in_mb"):
        if info.get(name, 1) <= 0:
            raise FileFormatError(path, f"{_DESCRIPTION}, with a positive {name}", repr(info[name]))
    for name, feature in info["features"].items():
        if not all(size > 0 for size in feature["shape"]):
            raise FileFormatError(path, f"a shape of positive sizes for the feature {name}", str(feature["shape"]))
    return info


def episode_files(root: Path) -> list[Path]:
    """The files of meta/episodes, in the order of their paths."""
    return visible_files(root / EPISODES_FOLDER, "*.parquet")


def split_range(text: object) -> range | None:
    """The episodes of a split, `FIRST:END` as in `meta/info.json`; None for any other form."""
    match = re.fullmatch(r"(\d+):(\d+)", str(text))
    return range(int(match[1]), int(match[2])) if match else None


def require_episodes(root: Path, info: dict[str, Any]) -> None:
    """Refuses a data set without episodes.

    Raises:
        FileFormatError: `total_episodes` is 0 and meta/episodes is empty.
    """
    if info["total_episodes"] == 0 and not episode_files(root):
        raise FileFormatError(root, "a data set with episodes", "an empty one (total_episodes is 0)")


def is_copolicy_info(info: Mapping[str, Any]) -> bool:
    """Whether `copolicy-convert` wrote a data set, by the keys in `meta/info.json` that LeRobot's tools keep."""
    features = info.get("features")
    action = features.get("action") if isinstance(features, dict) else None
    has_action_keys = isinstance(action, dict) and ("hold" in action or "record_hz" in action)
    return has_action_keys or str(info.get("robot_type") or "").startswith(_ROBOT_TYPE_PREFIX)


def stripped_hint(info: Mapping[str, Any], root: Path | str) -> str:
    """How to restore the episode columns of a data set of `copolicy-convert`; empty for any other data set.

    LeRobot's delete and split write meta/episodes without them.
    """
    if not is_copolicy_info(info):
        return ""
    return (
        f": LeRobot's delete and split drop them; copolicy-dataset amend {root} --restore-from ORIGINAL restores them "
        "from recordings or an earlier version, and copolicy-dataset select removes episodes but keeps all columns"
    )


def _describe_version(version: str) -> str:
    if version.startswith("v2"):
        convert = "python -m lerobot.scripts.convert_dataset_v21_to_v30 --repo-id=U/N --root=FOLDER --push-to-hub=false"
        return f"{version}; LeRobot converts this older version: {convert}"
    return repr(version)


def _describe_folder(root: Path) -> str:
    """Describes a path that is not a data set."""
    data_sets = sorted((*root.glob("*/meta/info.json"), *root.glob("*/*/meta/info.json")))
    if data_sets:
        return f"none, but a data set in {data_sets[0].parent.parent}"
    return describe_path(root)
