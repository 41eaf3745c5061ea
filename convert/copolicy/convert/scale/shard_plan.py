"""Assigns recordings to shards, and tracks which shards are finished."""

import hashlib
import json
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any, NotRequired, TypedDict

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.json_file import read_json
from copolicy.dataset.files.listing import is_hidden
from copolicy.dataset.files.staging import replace_json

from ..lerobot.prepare import Conversion

LOCK_FILE = "lock"
OPTIONS_FILE = "options.json"
RECORD_FILE = "shard.json"
DATA_SET = "set"
"""Folder of a shard's LeRobot data set; missing if every recording of the shard was skipped."""


class SkipRecord(TypedDict):
    """The recordings that a shard skipped, see `SkipReport`."""

    damaged: list[str]
    discarded: list[str]
    messages: list[str]


class ShardRecord(TypedDict):
    """`shard.json`: the contents of a finished shard.

    Attributes:
        digest: see `ShardPlan.digest`.
        episodes: `episode_uuid`s in the order of the shard.
        origins: file of each episode; missing in shards of an earlier version.
        findings: findings in the recordings, see `Finding`.
    """

    digest: str
    episodes: list[str]
    origins: NotRequired[list[str]]
    left_out: SkipRecord
    findings: list[dict[str, Any]]


@dataclass(frozen=True)
class ShardPlan:
    """One conversion, divided into shards of consecutive recordings.

    Attributes:
        folder: where shards are kept until they are merged.
        root: path of the merged data set.
        files: absolute paths of the recordings, in the order of the data set.
        shard_episodes: recordings in a shard.
        statistics: also compute `meta/copolicy_stats.json` of the merged data set.
        unfinished: names of unfinished recordings (`.part`).
    """

    folder: Path
    root: Path
    repo_id: str
    conversion: Conversion
    files: tuple[Path, ...]
    shard_episodes: int
    skip_damaged: bool = False
    statistics: bool = False
    unfinished: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Number of shards."""
        return -(-len(self.files) // self.shard_episodes)

    def files_of(self, rank: int) -> tuple[Path, ...]:
        """The recordings of a shard."""
        return self.files[rank * self.shard_episodes : (rank + 1) * self.shard_episodes]

    def shard(self, rank: int) -> Path:
        """The folder of a finished shard."""
        return self.folder / "shards" / f"{rank:05d}"

    def damage_list(self, rank: int) -> Path:
        """The file with a line for each damaged recording of a shard that could not be finished."""
        return self.folder / "damaged" / f"{rank:05d}.txt"

    @property
    def logs(self) -> Path:
        """datatrove's folder for the shards: completion marks, logs, job scripts."""
        return self.folder / "datatrove" / "shards"

    @property
    def merge_logs(self) -> Path:
        """datatrove's folder for the merge job."""
        return self.folder / "datatrove" / "merge"

    @cached_property
    def options(self) -> dict[str, Any]:
        """Options that all shards of a conversion share."""
        conversion = asdict(self.conversion)
        return {
            "fps": conversion.pop("fps"),
            "hold": conversion.pop("downsampling"),
            **conversion,
            "repo_id": self.repo_id,
            "shard_episodes": self.shard_episodes,
            "version": version("lerobot_policy_copolicy"),
        }

    def digest(self, rank: int) -> str:
        """Hash of the options and of path, size and modification time of each recording of a shard."""
        files = [(str(path), *_size_and_mtime(path)) for path in self.files_of(rank)]
        return hashlib.sha256(json.dumps([self.options, files], sort_keys=True).encode()).hexdigest()

    def record(self, rank: int) -> "ShardRecord | None":
        """The record of a finished shard, None if the shard is not finished or its record is invalid."""
        try:
            return read_json(self.shard(rank) / RECORD_FILE, ShardRecord, "the record of a shard")
        except FileFormatError:
            return None

    def require_own(self) -> None:
        """Checks that the folder is new or holds shards of a call with the same options.

        Raises:
            InvalidValueError: it holds shards of a call with other options.
            FileFormatError: it holds something else.
        """
        stored = self.folder / OPTIONS_FILE
        if stored.is_file():
            self._compare(stored, json.loads(json.dumps(self.options)))
        elif self.folder.is_dir() and any(
            entry.name != LOCK_FILE and not is_hidden(entry.name) for entry in self.folder.iterdir()
        ):
            raise FileFormatError(self.folder, "a new folder, or one with the shards of this call", "another")

    def prepare(self) -> int:
        """Creates the folder, and removes shards whose recordings changed since.

        Returns:
            Number of finished shards.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        replace_json(self.folder / OPTIONS_FILE, self.options)
        shutil.rmtree(self.merge_logs / "completions", ignore_errors=True)
        finished = 0
        for path in sorted((self.folder / "shards").glob("[0-9]*")):
            rank = int(path.name)
            record = self.record(rank)
            if rank < len(self) and record is not None and record["digest"] == self.digest(rank):
                finished += 1
            else:
                shutil.rmtree(path)
        for completion in (self.logs / "completions").glob("[0-9]*"):
            if not self.shard(int(completion.name)).is_dir():
                completion.unlink()
        return finished

    def _compare(self, stored: Path, options: dict[str, Any]) -> None:
        stored_options = read_json(stored, dict[str, Any], "the options of a conversion")
        differ = [name for name in {**stored_options, **options} if stored_options.get(name) != options.get(name)]
        if differ:
            name = differ[0]
            raise InvalidValueError(
                f"{name} of the shards in {self.folder}",
                f"{options.get(name)!r} (finish that call first, or give another --shards)",
                stored_options.get(name),
            )


def _size_and_mtime(path: Path) -> tuple[int, int]:
    """Size and modification time of a file; zeros for a broken link, which reading the recording reports."""
    try:
        status = path.stat()
    except OSError:
        return 0, 0
    return status.st_size, status.st_mtime_ns


def absolute(files: Sequence[Path]) -> tuple[Path, ...]:
    """Absolute paths, valid on every machine that mounts this file system."""
    return tuple(path.absolute() for path in files)
