"""Appends recordings to a data set as new files, without rewriting the existing ones."""

import shutil
import tempfile
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from copolicy.dataset.clock import Downsampling
from copolicy.dataset.edit.subset.stored_set import stored_record, write_record
from copolicy.dataset.exceptions import CopolicyError, FileFormatError, InvalidValueError, MissingExtraError
from copolicy.dataset.files.meta_files import CARD_FILE, EPISODES_FOLDER, INFO_FILE, RECORD_FILE, STATS_FILE, TASKS_FILE
from copolicy.dataset.files.replace_folder import finish_interrupted, swap_folders
from copolicy.dataset.files.staging import named_errors, write_lerobot_json
from copolicy.dataset.lerobot_folder.info import read_info, task_name, task_of
from copolicy.dataset.lerobot_folder.loading import require_loadable
from copolicy.dataset.lerobot_folder.references import FileIndex, chunk_files
from copolicy.dataset.lerobot_folder.tables import read_parquet
from copolicy.dataset.publication.minimal_card import is_minimal_card, write_minimal_card
from copolicy.dataset.recording.reader import read_metadata

from ..recordings import convert_recordings, find_recordings
from ..video.scene_video import SCENE
from .linked_copy import add_later_columns, copy_as_links
from .mixtures import Mixtures
from .prepare import Conversion
from .shifted_tables import Shift, read_episode_columns, write_with_schema
from .stored_rewards import reward_differences

try:
    from lerobot.datasets.compute_stats import aggregate_stats
    from lerobot.datasets.io_utils import load_stats, write_stats
    from lerobot.datasets.utils import update_chunk_file_indices
except ImportError as error:
    raise MissingExtraError((error.name or "lerobot").split(".")[0]) from None


def stored_sampling(root: Path, fps: int | None, downsampling: Downsampling | None) -> tuple[int, Downsampling]:
    """Returns the rate and downsampling of a data set, which appended episodes must share.

    Raises:
        FileFormatError: no data set of `copolicy-convert`.
        InvalidValueError: `fps` or `downsampling` is given and differs.
    """
    finish_interrupted(root)
    info = read_info(root)
    try:
        stored = int(info["fps"]), info["features"]["action"]["hold"]
    except (KeyError, TypeError, ValueError):
        raise FileFormatError(root / INFO_FILE, "a data set of copolicy-convert", "another") from None
    for flag, value, expected in (("--fps", fps, stored[0]), ("--downsampling", downsampling, stored[1])):
        if value is not None and value != expected:
            raise InvalidValueError(flag, f"{expected!r}, as {root} has it", value)
    return stored


def stored_video_size(root: Path, requested: bool, size: tuple[int, int] | None) -> tuple[int, int] | None:
    """Returns width and height (px) of a data set's video, which appended episodes get too; None if it has no video.

    Args:
        requested: whether the caller requests a video.
        size: the requested width and height, or None for the stored size.

    Raises:
        InvalidValueError: another size is requested, or a video where the data set has none.
    """
    feature = read_info(root).get("features", {}).get(SCENE)
    if feature is None:
        if requested:
            raise InvalidValueError("--video", f"none, as {root} has no video", "one")
        return None
    height, width, _ = feature["shape"]
    if size and size != (width, height):
        raise InvalidValueError("--video-size", f"{width}x{height}, as {root} has it", "{}x{}".format(*size))
    return width, height


def append_recordings(
    folders: Sequence[Path | str],
    root: Path | str,
    repo_id: str,
    conversion: Conversion,
    skip_damaged: bool = False,
    workers: int = 1,
) -> dict[str, Any]:
    """Appends the recordings in `folders` whose episodes are not yet in the data set at `root`.

    A folder beside `root` gets hard links to the existing files and the new files, and then replaces `root`. An
    interruption leaves the old or the new data set; between the two renames it has a hidden name, and the next call
    restores it.

    Returns:
        Summary of the appended episodes.

    Raises:
        FileFormatError: no data set at `root`, or one with other columns.
        RunError: no new recording is usable; nothing was changed.
    """
    root = Path(root)
    finish_interrupted(root)
    require_loadable(root)
    files, unfinished = find_recordings(folders)
    stored = {name for path in chunk_files(root / EPISODES_FOLDER).values() for name in _uuids(path)}
    new = [path for path in files if _uuid(path) not in stored]
    summary: dict[str, Any] = {"root": str(root), "already_there": len(files) - len(new), "episodes_added": 0}
    if not new:
        return {**summary, "unfinished_recordings": unfinished}
    target = root.resolve()
    rewards = reward_differences([root])
    with tempfile.TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as scratch:
        addition, staged = Path(scratch) / "added", Path(f"{scratch}.whole")
        try:
            with named_errors(root, targets={addition: root, staged: root}):
                written = convert_recordings(new, addition, repo_id, conversion, skip_damaged, workers)
                copy_as_links(target, staged)
                new_columns = add_later_columns(staged)
                info = _join(staged, addition)
                mixtures = _mixtures(staged, rewards)
                shutil.rmtree(swap_folders(staged, target))
        except CopolicyError as error:
            # The temporary folders no longer exist when the message is read.
            error.args = (str(error).replace(str(addition), str(root)).replace(str(staged), str(root)),)
            raise
        finally:
            shutil.rmtree(staged, ignore_errors=True)
    return {
        **summary,
        "episodes_added": written["episodes"],
        "frames_added": written["frames"],
        "episodes": info["total_episodes"],
        "frames": info["total_frames"],
        "damaged_left_out": written["damaged_left_out"],
        "discarded_left_out": written["discarded_left_out"],
        "unfinished_recordings": unfinished,
        **({"columns_added": new_columns} if new_columns else {}),
        **mixtures.summary(),
        "not_verified": written["not_verified"],
    }


def _mixtures(root: Path, rewards: list[str]) -> Mixtures:
    record = stored_record(root)
    return Mixtures.from_rows(
        read_episode_columns(root), task_of(read_info(root)), root, [record, *record.get("appended", [])], rewards
    )


def _join(staged: Path, addition: Path) -> dict[str, Any]:
    """Appends the files of `addition` to those of `staged`, a copy that is not in use; returns the new info."""
    info, new = read_info(staged), read_info(addition)
    if info["features"] != new["features"]:
        names = {*info["features"], *new["features"]}
        differ = sorted(name for name in names if info["features"].get(name) != new["features"].get(name))
        raise FileFormatError(staged / INFO_FILE, "the features of these recordings", f"others: {', '.join(differ)}")
    if read_parquet(staged / TASKS_FILE).to_pylist() != read_parquet(addition / TASKS_FILE).to_pylist():
        raise FileFormatError(staged / TASKS_FILE, "the one task of copolicy-convert", "other tasks")
    shift = Shift(info["total_episodes"], info["total_frames"])
    data: dict[FileIndex, FileIndex] = {}
    last, schema_file = list(chunk_files(staged / "data").items())[-1]
    for old, path in chunk_files(addition / "data").items():
        data[old] = last = update_chunk_file_indices(*last, info["chunks_size"])
        write_with_schema(shift.frame_table(read_parquet(path)), schema_file, _numbered_path(staged / "data", last))
    moved = {"data": data, **_move_videos(staged, addition, info)}
    last, schema_file = list(chunk_files(staged / EPISODES_FOLDER).items())[-1]
    for path in chunk_files(addition / EPISODES_FOLDER).values():
        last = update_chunk_file_indices(*last, info["chunks_size"])
        table = shift.episode_table(read_parquet(path), moved, last)
        write_with_schema(table, schema_file, _numbered_path(staged / EPISODES_FOLDER, last))
    statistics = [load_stats(staged), shift.statistics(load_stats(addition) or {})]
    total = info["total_episodes"] + new["total_episodes"]
    if info.get("splits") == {"train": f"0:{info['total_episodes']}"}:
        info["splits"] = {"train": f"0:{total}"}
    info["total_episodes"], info["total_frames"] = total, info["total_frames"] + new["total_frames"]
    record, part = stored_record(staged), stored_record(addition)
    notes = {**record.get("notes", {}), **part.pop("notes", {})}
    part.pop("task", None)  # the record of the data set has it
    part["version"] = version("lerobot_policy_copolicy")
    record = {**record, "notes": notes, "appended": [*record.get("appended", []), part]}
    _renew_minimal_card(staged)
    for name in (INFO_FILE, STATS_FILE, RECORD_FILE):
        (staged / name).unlink(missing_ok=True)  # a hard link: writing to it would change the data set in use
    write_stats(aggregate_stats(statistics), staged)
    write_lerobot_json(staged / INFO_FILE, info)
    write_record(staged, record)
    return info


def _renew_minimal_card(root: Path) -> None:
    """Rewrites the minimal card, whose licence may no longer hold for all episodes; keeps any other card."""
    path = root / CARD_FILE
    if path.exists() and not is_minimal_card(path):
        return
    path.unlink(missing_ok=True)  # a hard link to the file in use
    write_minimal_card(path, {row["license"] for row in read_episode_columns(root)}, task_name(read_info(root)))


def _move_videos(staged: Path, addition: Path, info: dict[str, Any]) -> dict[str, dict[FileIndex, FileIndex]]:
    """Moves the video files behind the existing ones; returns the new number of each file, by folder."""
    moved: dict[str, dict[FileIndex, FileIndex]] = {}
    for key in (name for name, feature in info["features"].items() if feature["dtype"] == "video"):
        folder = f"videos/{key}"
        last = list(chunk_files(staged / folder, "mp4"))[-1]
        numbers = moved[folder] = {}
        for old, path in chunk_files(addition / folder, "mp4").items():
            numbers[old] = last = update_chunk_file_indices(*last, info["chunks_size"])
            target = _numbered_path(staged / folder, last, "mp4")
            target.parent.mkdir(parents=True, exist_ok=True)
            path.rename(target)
    return moved


def _numbered_path(folder: Path, number: FileIndex, suffix: str = "parquet") -> Path:
    return folder / f"chunk-{number[0]:03d}" / f"file-{number[1]:03d}.{suffix}"


def _uuids(path: Path) -> list[str]:
    table = read_parquet(path)
    if "episode_uuid" not in table.column_names:
        raise FileFormatError(path, "the episode columns of copolicy", "no episode_uuid")
    return table.column("episode_uuid").to_pylist()


def _uuid(path: Path) -> str | None:
    try:
        return read_metadata(path).get("episode", {}).get("episode_uuid")
    except CopolicyError:
        return None  # damaged: the conversion reports it
