"""The episodes of a LeRobot v3 data set of this task, one after the other, for the exporters."""

import json
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.clock import stride
from copolicy.dataset.episode import EPISODE_COLUMNS, LATER_COLUMNS, LATER_DEFAULTS
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, MissingExtraError, RunError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, FEATURES, HUMAN_ACTION, STATE, theta_of
from copolicy.dataset.files import visible_files
from copolicy.dataset.physics_text import physics_counts, physics_of
from copolicy.dataset.task import RECORD_HZ, Physics

from ..dynamics import integrate
from ..upstream_episode import states_7

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ModuleNotFoundError:
    raise MissingExtraError("pyarrow") from None

# A merge with a set that lacks a column leaves nulls, which none of the formats can hold.
_UNKNOWN: dict[str, Any] = {"str": "", "int": -1, "float": math.nan, "bool": False}


@dataclass(frozen=True, repr=False)
class ExportEpisode:
    """One episode as the data set has it: `actions[t]` was taken in `states[t]`.

    Attributes:
        index: its `episode_index`.
        states: `(T, 7)` float32.
        environment: `(11,)` float32.
        human_actions: `(T, 2)` float32, of the frame before.
        actions: `(T, 4)` float32.
        rewards: `(T,)` float32.
        meta: its episode columns.
        fps: frames a second.
        physics: what led from state to state; the default where the data set does not say.
    """

    index: int
    states: np.ndarray
    environment: np.ndarray
    human_actions: np.ndarray
    actions: np.ndarray
    rewards: np.ndarray
    meta: dict[str, Any]
    fps: int
    physics: Physics

    def __len__(self) -> int:
        return len(self.actions)

    def final_state(self) -> np.ndarray:
        """`(7,)` float32, the state that the last action led to.

        The data set ends with the last action, so that it is integrated from the last state over the steps that
        `duration_s` leaves for the last frame, under the episode's own physics.
        """
        step = stride(self.fps)
        steps = round(self.meta["duration_s"] * RECORD_HZ) - step * (len(self) - 1)
        x, y, _, _, vx, vy, omega = self.states[-1].astype(float).tolist()
        held = np.repeat(self.actions[-1:].astype(float), min(max(steps, 1), step), axis=0)
        after = integrate((x, y, float(theta_of(self.states[-1]))), (vx, vy, omega), held, self.physics)
        return states_7(after[-1]).astype(np.float32)

    def next_states(self) -> np.ndarray:
        """`(T, 7)` float32, the state of the following frame."""
        return np.vstack((self.states[1:], self.final_state()))


@dataclass(frozen=True)
class ExportSource:
    """A data set to export.

    Attributes:
        hold: how a frame's action was made of its steps.
        splits: ranges of `episode_index` by name.
        rows: one dict an exported episode: `episode_index`, `length` and the episode columns.
        left_out: discarded episodes that are not exported.
    """

    root: Path
    fps: int
    hold: str
    splits: dict[str, range]
    rows: tuple[dict[str, Any], ...]
    left_out: int
    _lengths: dict[int, int] = field(repr=False)

    @classmethod
    def open(cls, root: Path, keep_discarded: bool = False) -> "ExportSource":
        """Reads the metadata of a data set.

        Args:
            keep_discarded: export, too, what its operator discarded or `copolicy-dataset exclude` flagged.

        Raises:
            FileFormatError: no LeRobot v3 data set of this task.
            RunError: no episode is left.
        """
        path = root / "meta" / "info.json"
        if not path.is_file():
            raise FileFormatError(root, "a LeRobot v3 data set with meta/info.json", "none")
        try:
            info = json.loads(path.read_text(encoding="utf-8"))
            version, fps, features = str(info["codebase_version"]), int(info["fps"]), info["features"]
            hold = str(features[ACTION].get("hold", "unknown"))
            splits = {name: _range(text) for name, text in (info.get("splits") or {}).items()}
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise FileFormatError(path, "LeRobot's info as JSON", f"{type(error).__name__} {error}") from None
        if not version.startswith("v3"):
            raise FileFormatError(path, "codebase_version v3.x", version)
        stride(fps)
        rows = _episode_rows(root)
        kept = tuple(row for row in rows if keep_discarded or not row["discarded"])
        if not kept:
            raise RunError(f"{root}: expected an episode to export, found {len(rows)}, all discarded")
        lengths = {row["episode_index"]: row["length"] for row in rows}
        return cls(root, fps, hold, splits, kept, len(rows) - len(kept), lengths)

    @property
    def frames(self) -> int:
        """Frames of the exported episodes."""
        return sum(row["length"] for row in self.rows)

    def facts(self) -> dict[str, Any]:
        """What every exported file says of where it comes from."""
        sources = Counter(row["source"] for row in self.rows)
        licenses = sorted({row["license"] for row in self.rows} - {""})
        return {
            "format_of_origin": "LeRobot v3, copolicy table carrying",
            "fps": self.fps,
            "hold": self.hold,
            "sources": dict(sorted(sources.items())),
            "simulated": bool(sources["simulated"]),
            "licenses": licenses,
            "physics": physics_counts(row["physics"] for row in self.rows),
        }

    @property
    def physics(self) -> Physics | None:
        """The settings that led from state to state in all exported episodes; None where they differ or are unknown."""
        settings = {physics_of(row["physics"]) for row in self.rows}
        return next(iter(settings)) if len(settings) == 1 else None

    def episodes(self) -> Iterator[ExportEpisode]:
        """The exported episodes in order; one data file is in memory at a time.

        Raises:
            FileFormatError: the frames are not those that the metadata tells of.
        """
        wanted = {row["episode_index"]: row for row in self.rows}
        expected = iter(sorted(self._lengths))
        for path in visible_files(self.root / "data", "*.parquet"):
            columns = _frames(path)
            numbers = columns["episode_index"]
            starts = np.flatnonzero(np.diff(numbers, prepend=-1))
            for start, end in zip(starts, np.append(starts[1:], len(numbers)), strict=True):
                index, due = int(numbers[start]), next(expected, None)
                if index != due or end - start != self._lengths[index]:
                    promised = (
                        f"episode {due} with {self._lengths[due]} frames" if due is not None else "no more frames"
                    )
                    raise FileFormatError(path, f"{promised}, next", f"episode {index} with {end - start}")
                if index in wanted:
                    part = {name: values[start:end] for name, values in columns.items()}
                    yield _episode(index, part, wanted[index], self.fps)
        if (due := next(expected, None)) is not None:
            raise FileFormatError(self.root / "data", f"the frames of episode {due}", "none")


def _range(text: str) -> range:
    first, last = str(text).split(":")
    return range(int(first), int(last))


def _episode(index: int, part: dict[str, np.ndarray], row: dict[str, Any], fps: int) -> ExportEpisode:
    meta = {name: row[name] for name in EPISODE_COLUMNS}
    return ExportEpisode(
        index, part[STATE], part[ENVIRONMENT_STATE][0], part[HUMAN_ACTION], part[ACTION], part["next.reward"], meta,
        fps, physics_of(row["physics"]) or Physics(),
    )  # fmt: skip


def _episode_rows(root: Path) -> list[dict[str, Any]]:
    names = ("episode_index", "length", *EPISODE_COLUMNS)
    rows: list[dict[str, Any]] = []
    for path in visible_files(root / "meta" / "episodes", "*.parquet"):
        rows += [LATER_DEFAULTS | row for row in _read(path, names, LATER_COLUMNS).to_pylist()]
    if not rows:
        raise FileFormatError(root, "a LeRobot data set with episodes under meta/episodes", "none")
    for row in rows:
        unknown = {name: _UNKNOWN[kind] for name, kind in EPISODE_COLUMNS.items()} | LATER_DEFAULTS
        row |= {name: value for name, value in unknown.items() if row[name] is None}
        try:
            physics_of(row["physics"])
        except InvalidValueError as error:
            raise FileFormatError(root, f"the settings of episode {row['episode_index']}", str(error)) from None
    return sorted(rows, key=lambda row: row["episode_index"])


def _frames(path: Path) -> dict[str, np.ndarray]:
    names = (STATE, ENVIRONMENT_STATE, HUMAN_ACTION, ACTION, "next.reward")
    table = _read(path, (*names, "episode_index"))
    columns = {"episode_index": table["episode_index"].to_numpy()}
    for name in names:
        (width,) = FEATURES[name]["shape"]
        column = table[name].combine_chunks()
        flat = column if width == 1 and pa.types.is_primitive(column.type) else column.flatten()
        values = flat.to_numpy(zero_copy_only=False)
        if len(values) != width * len(table) or not np.isfinite(values).all():
            raise FileFormatError(path, f"{name} of {width} finite numbers a frame", "others")
        columns[name] = values.reshape(-1, width) if width > 1 else values
    return columns


def _read(path: Path, names: tuple[str, ...], optional: tuple[str, ...] = ()) -> "pa.Table":
    try:
        # One file, not a data set of pyarrow's, which would take chunk-000 for a partition.
        with pq.ParquetFile(path) as file:
            missing = [name for name in names if name not in file.schema_arrow.names]
            if lacking := [name for name in missing if name not in optional]:
                raise FileFormatError(path, "the columns of copolicy", f"none named {', '.join(lacking)}")
            return file.read(columns=[name for name in names if name not in missing])
    except (pa.ArrowException, OSError) as error:
        raise FileFormatError(path, "a complete Parquet file", str(error).splitlines()[0]) from None
