"""Adds recordings to a data set without rewriting what is there: new files beside the old ones."""

import shutil
import tempfile
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from copolicy.dataset.clock import Hold
from copolicy.dataset.edit.subset.stored_set import stored_record, write_record
from copolicy.dataset.exceptions import CopolicyError, FileFormatError, InvalidValueError, MissingExtraError
from copolicy.dataset.files.meta_files import CARD_FILE, EPISODES_FOLDER, INFO_FILE, RECORD_FILE, STATS_FILE, TASKS_FILE
from copolicy.dataset.files.replace_folder import finish_interrupted, take_place
from copolicy.dataset.files.staging import about, write_as_lerobot
from copolicy.dataset.lerobot_folder.info import read_info, task_name, task_of
from copolicy.dataset.lerobot_folder.loading import require_loadable
from copolicy.dataset.lerobot_folder.references import Place, numbered_files
from copolicy.dataset.lerobot_folder.tables import read_parquet
from copolicy.dataset.publication.minimal_card import is_minimal_card, write_minimal_card
from copolicy.dataset.recording.log import read_metadata

from ..recordings import convert_recordings, find_recordings
from ..video.scene_video import SCENE
from .linked_copy import add_later_columns, copy_as_links
from .mixtures import Mixtures
from .prepare import Conversion
from .shifted_tables import Shift, episode_rows, write_like
from .stored_rewards import foreign_rewards

try:
    from lerobot.datasets.compute_stats import aggregate_stats
    from lerobot.datasets.io_utils import load_stats, write_stats
    from lerobot.datasets.utils import update_chunk_file_indices
except ImportError as error:
    raise MissingExtraError((error.name or "lerobot").split(".")[0]) from None


def stored_clock(root: Path, fps: int | None, hold: Hold | None) -> tuple[int, Hold]:
    """Rate and hold of a data set, which what is added must share.

    Raises:
        FileFormatError: no data set of `copolicy-convert`.
        InvalidValueError: another rate or hold is asked for.
    """
    finish_interrupted(root)
    info = read_info(root)
    try:
        stored = int(info["fps"]), info["features"]["action"]["hold"]
    except (KeyError, TypeError, ValueError):
        raise FileFormatError(root / INFO_FILE, "a data set of copolicy-convert", "another") from None
    for name, asked, found in (("--fps", fps, stored[0]), ("--downsampling", hold, stored[1])):
        if asked is not None and asked != found:
            raise InvalidValueError(name, f"{found!r}, as {root} has it", asked)
    return stored


def stored_video(root: Path, asked: bool, size: tuple[int, int] | None) -> tuple[int, int] | None:
    """Width and height (px) of a data set's video, which what is added gets, too; None where it has none.

    Args:
        asked: whether a video is asked for.
        size: its size, if one was named.

    Raises:
        InvalidValueError: another size, or a video where the data set has none.
    """
    feature = read_info(root).get("features", {}).get(SCENE)
    if feature is None:
        if asked:
            raise InvalidValueError("--video", f"none, as {root} has no video", "one")
        return None
    height, width, _ = feature["shape"]
    if size and size != (width, height):
        raise InvalidValueError("--video-size", f"{width}x{height}, as {root} has it", "{}x{}".format(*size))
    return width, height


def append_recordings(
    folders: Sequence[Path],
    root: Path,
    repo_id: str,
    conversion: Conversion,
    skip_damaged: bool = False,
    workers: int = 1,
) -> dict:
    """Adds those recordings in `folders` whose episodes are not in the data set at `root` yet.

    A folder beside `root` takes hard links to the files that are there and the new ones, and then its place. An
    interruption leaves the data set as it was or complete; between the two renamings it lies under a hidden name,
    from where the next call brings it back.

    Returns:
        Summary of what was added.

    Raises:
        FileFormatError: no data set at `root`, or one with other columns.
        RunError: nothing usable among what is new; nothing was changed.
    """
    finish_interrupted(root)
    require_loadable(root)
    files, unfinished = find_recordings(folders)
    known = {name for path in numbered_files(root / EPISODES_FOLDER).values() for name in _uuids(path)}
    new = [path for path in files if _uuid(path) not in known]
    summary: dict[str, Any] = {"root": str(root), "already_there": len(files) - len(new), "episodes_added": 0}
    if not new:
        return {**summary, "unfinished_recordings": unfinished}
    place = root.resolve()
    rewards = foreign_rewards([root])
    with tempfile.TemporaryDirectory(prefix=f".{place.name}.", dir=place.parent) as scratch:
        added, whole = Path(scratch) / "added", Path(f"{scratch}.whole")
        try:
            with about(root, places={added: root, whole: root}):
                written = convert_recordings(new, added, repo_id, conversion, skip_damaged, workers)
                copy_as_links(place, whole)
                columns_added = add_later_columns(whole)
                info = _join(whole, added)
                mixtures = _mixtures(whole, rewards)
                shutil.rmtree(take_place(whole, place))
        except CopolicyError as error:
            # The folders in the making are gone when somebody reads this.
            error.args = (str(error).replace(str(added), str(root)).replace(str(whole), str(root)),)
            raise
        finally:
            shutil.rmtree(whole, ignore_errors=True)
    return {
        **summary,
        "episodes_added": written["episodes"],
        "frames_added": written["frames"],
        "episodes": info["total_episodes"],
        "frames": info["total_frames"],
        "damaged_left_out": written["damaged_left_out"],
        "discarded_left_out": written["discarded_left_out"],
        "unfinished_recordings": unfinished,
        **({"columns_added": columns_added} if columns_added else {}),
        **mixtures.summary(),
        "not_verified": written["not_verified"],
    }


def _mixtures(whole: Path, rewards: list[str]) -> Mixtures:
    record = stored_record(whole)
    return Mixtures.of(
        episode_rows(whole), task_of(read_info(whole)), whole, [record, *record.get("appended", [])], rewards
    )


def _join(whole: Path, added: Path) -> dict[str, Any]:
    """Puts the files of `added` behind those of `whole`, which is not in use yet; returns the new info."""
    info, new = read_info(whole), read_info(added)
    if info["features"] != new["features"]:
        names = {*info["features"], *new["features"]}
        differ = sorted(name for name in names if info["features"].get(name) != new["features"].get(name))
        raise FileFormatError(whole / INFO_FILE, "the features of these recordings", f"others: {', '.join(differ)}")
    if read_parquet(whole / TASKS_FILE).to_pylist() != read_parquet(added / TASKS_FILE).to_pylist():
        raise FileFormatError(whole / TASKS_FILE, "the one task of copolicy-convert", "others")
    shift = Shift(info["total_episodes"], info["total_frames"])
    data: dict[Place, Place] = {}
    last, example = list(numbered_files(whole / "data").items())[-1]
    for old, path in numbered_files(added / "data").items():
        data[old] = last = update_chunk_file_indices(*last, info["chunks_size"])
        write_like(shift.frame_table(read_parquet(path)), example, _numbered(whole / "data", last))
    moved = {"data": data, **_move_videos(whole, added, info)}
    last, example = list(numbered_files(whole / EPISODES_FOLDER).items())[-1]
    for path in numbered_files(added / EPISODES_FOLDER).values():
        last = update_chunk_file_indices(*last, info["chunks_size"])
        table = shift.episode_table(read_parquet(path), moved, last)
        write_like(table, example, _numbered(whole / EPISODES_FOLDER, last))
    statistics = [load_stats(whole), shift.statistics(load_stats(added) or {})]
    total = info["total_episodes"] + new["total_episodes"]
    if info.get("splits") == {"train": f"0:{info['total_episodes']}"}:
        info["splits"] = {"train": f"0:{total}"}
    info["total_episodes"], info["total_frames"] = total, info["total_frames"] + new["total_frames"]
    record, part = stored_record(whole), stored_record(added)
    notes = {**record.get("notes", {}), **part.pop("notes", {})}
    part.pop("task", None)  # that of the whole
    part["version"] = version("lerobot_policy_copolicy")
    record = {**record, "notes": notes, "appended": [*record.get("appended", []), part]}
    _renew_minimal_card(whole)
    for name in (INFO_FILE, STATS_FILE, RECORD_FILE):
        (whole / name).unlink(missing_ok=True)  # a link: writing into it would change the data set in use
    write_stats(aggregate_stats(statistics), whole)
    write_as_lerobot(whole / INFO_FILE, info)
    write_record(whole, record)
    return info


def _renew_minimal_card(root: Path) -> None:
    """The licence may hold no longer for all; a card is left as it is."""
    path = root / CARD_FILE
    if path.exists() and not is_minimal_card(path):
        return
    path.unlink(missing_ok=True)  # a link
    write_minimal_card(path, {row["license"] for row in episode_rows(root)}, task_name(read_info(root)))


def _move_videos(whole: Path, added: Path, info: dict[str, Any]) -> dict[str, dict[Place, Place]]:
    """Moves the video files behind those that are there; where each went, by folder."""
    moved: dict[str, dict[Place, Place]] = {}
    for key in (name for name, feature in info["features"].items() if feature["dtype"] == "video"):
        folder = f"videos/{key}"
        last = list(numbered_files(whole / folder, "mp4"))[-1]
        places = moved[folder] = {}
        for old, path in numbered_files(added / folder, "mp4").items():
            places[old] = last = update_chunk_file_indices(*last, info["chunks_size"])
            target = _numbered(whole / folder, last, "mp4")
            target.parent.mkdir(parents=True, exist_ok=True)
            path.rename(target)
    return moved


def _numbered(folder: Path, place: Place, suffix: str = "parquet") -> Path:
    return folder / f"chunk-{place[0]:03d}" / f"file-{place[1]:03d}.{suffix}"


def _uuids(path: Path) -> list[str]:
    table = read_parquet(path)
    if "episode_uuid" not in table.column_names:
        raise FileFormatError(path, "the episode columns of copolicy", "no episode_uuid")
    return table.column("episode_uuid").to_pylist()


def _uuid(path: Path) -> str | None:
    try:
        return read_metadata(path).get("episode", {}).get("episode_uuid")
    except CopolicyError:
        return None  # damaged: the conversion says so
