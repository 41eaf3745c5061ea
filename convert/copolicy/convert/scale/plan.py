"""Which recordings go into which shard, and which shards are finished."""

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
"""Folder of a shard's own LeRobot data set; missing where every recording of the shard was left out."""


class LeftOutRecord(TypedDict):
    """The recordings that a shard left out, see `LeftOut`."""

    damaged: list[str]
    discarded: list[str]
    messages: list[str]


class ShardRecord(TypedDict):
    """`shard.json`: what a finished shard holds.

    Attributes:
        digest: of all that the shard depends on.
        episodes: `episode_uuid`s in the order of the shard.
        origins: the file of each; a shard of an earlier version does not say.
        findings: of the recordings, see `Finding`.
    """

    digest: str
    episodes: list[str]
    origins: NotRequired[list[str]]
    left_out: LeftOutRecord
    findings: list[dict[str, Any]]


@dataclass(frozen=True)
class ShardPlan:
    """One conversion, cut into runs of recordings of equal number.

    Attributes:
        folder: where shards are kept until they are merged.
        root: where the merged data set goes.
        files: the recordings in the order of the data set, absolute paths.
        shard_episodes: recordings in a shard.
        statistics: compute `meta/copolicy_stats.json` of the merged set, too.
        unfinished: names of recordings that broke off.
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
        """A file with a line for each damaged recording that keeps a shard from being finished."""
        return self.folder / "damaged" / f"{rank:05d}.txt"

    @property
    def logs(self) -> Path:
        """datatrove's folder for the shards: what is completed, its logs, its job scripts."""
        return self.folder / "datatrove" / "shards"

    @property
    def merge_logs(self) -> Path:
        """The same for the job that merges."""
        return self.folder / "datatrove" / "merge"

    @cached_property
    def options(self) -> dict[str, Any]:
        """What shards must share to belong together."""
        return {
            **asdict(self.conversion),
            "repo_id": self.repo_id,
            "shard_episodes": self.shard_episodes,
            "version": version("lerobot_policy_copolicy"),
        }

    def digest(self, rank: int) -> str:
        """Of all that a shard depends on; a recording is known by its path, size and time of change."""
        files = [(str(path), *_state(path)) for path in self.files_of(rank)]
        return hashlib.sha256(json.dumps([self.options, files], sort_keys=True).encode()).hexdigest()

    def record(self, rank: int) -> "ShardRecord | None":
        """What a finished shard says of itself, None where it is not finished or says something else."""
        try:
            return read_json(self.shard(rank) / RECORD_FILE, ShardRecord, "the record of a shard")
        except FileFormatError:
            return None

    def require_own(self) -> None:
        """Checks that the folder is new or holds the shards of a call like this one.

        Raises:
            InvalidValueError: it holds those of a call with other options.
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
        """Makes the folder, and takes out shards whose recordings changed since.

        Returns:
            Number of shards that are finished already.
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
        found = read_json(stored, dict[str, Any], "the options of a conversion")
        differ = [name for name in {**found, **options} if found.get(name) != options.get(name)]
        if differ:
            name = differ[0]
            raise InvalidValueError(
                f"{name} of the shards in {self.folder}",
                f"{options.get(name)!r} (finish that call first, or give another --shards)",
                found.get(name),
            )


def _state(path: Path) -> tuple[int, int]:
    """Size and time of change; of a link that leads nowhere neither, which whoever reads the recording says."""
    try:
        status = path.stat()
    except OSError:
        return 0, 0
    return status.st_size, status.st_mtime_ns


def absolute(files: Sequence[Path]) -> tuple[Path, ...]:
    """Paths that mean the same on every machine that sees this file system."""
    return tuple(path.absolute() for path in files)
