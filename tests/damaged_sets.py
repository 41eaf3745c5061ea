"""Every way to damage a field of a LeRobot data set's tables and JSON files, one at a time."""

import json
import math
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from copolicy.dataset.episode import EPISODE_COLUMNS

JSON_VALUES: tuple[Any, ...] = (None, "text", -1, 1.5, math.nan, [], {}, True)
"""What a JSON field is replaced by."""
_LIST_ITEMS = 2  # of a long list, the fields of so many entries


@dataclass(frozen=True)
class Damage:
    """One damaged field.

    Attributes:
        file: path of the file below the data set's folder.
        field: column, JSON path, or empty for the file as a whole.
        kind: what was done to it.
    """

    file: str
    field: str
    kind: str
    apply: Callable[[Path], None]

    def __str__(self) -> str:
        return f"{self.file} {self.field}: {self.kind}"


def damages(root: Path) -> Iterator[Damage]:
    """Every damage of a data set's files, in a fixed order; videos, cards and hidden files are left alone."""
    for path in sorted(root.rglob("*")):
        name = path.relative_to(root).as_posix()
        if path.suffix not in (".parquet", ".json") or path.name.startswith("."):
            continue
        yield from _of_file(name)
        yield from _of_table(path, name) if path.suffix == ".parquet" else _of_json(path, name)


def _of_file(name: str) -> Iterator[Damage]:
    def truncate(path: Path) -> None:
        content = path.read_bytes()
        path.write_bytes(content[: len(content) // 2])

    def become_folder(path: Path) -> None:
        path.unlink()
        path.mkdir()

    for kind, change in (
        ("missing", Path.unlink),
        ("empty", lambda path: path.write_bytes(b"")),
        ("cut in half", truncate),
        ("other bytes", lambda path: path.write_bytes(b"\xff\x00 neither JSON nor Parquet \xfe" * 9)),
        ("a folder", become_folder),
    ):
        yield Damage(name, "", kind, lambda root, change=change: change(root / name))


def _of_table(path: Path, name: str) -> Iterator[Damage]:
    table = pq.ParquetFile(path).read()
    for column in table.column_names:
        for kind, values in _column_damages(table.column(column)):

            def apply(root: Path, column: str = column, values: pa.Array | None = values) -> None:
                place = table.column_names.index(column)
                changed = table.remove_column(place)
                if values is not None:
                    changed = table.set_column(place, column, values)
                pq.write_table(changed, root / name)

            yield Damage(name, column, kind, apply)
    yield Damage(name, "", "no row", lambda root: pq.write_table(table.slice(0, 0), root / name))
    yield Damage(name, "", "a row less", lambda root: pq.write_table(table.slice(1), root / name))
    twice = pa.concat_tables([table, table.slice(0, 1)])
    yield Damage(name, "", "a row twice", lambda root: pq.write_table(twice, root / name))


def _column_damages(column: pa.ChunkedArray) -> Iterator[tuple[str, pa.Array | None]]:
    kind, values = column.type, column.to_pylist()
    middle = len(values) // 2
    one_null = [None if place == middle else value for place, value in enumerate(values)]
    yield "missing", None
    yield "one empty value", pa.array(one_null, kind)
    yield "all empty", pa.nulls(len(values), kind)
    yield "no type", pa.nulls(len(values))
    if not pa.types.is_string(kind):
        yield "texts", pa.array([str(value) for value in values])
    yield "dicts", pa.array([{"value": 1}] * len(values))
    if pa.types.is_nested(kind):
        first = values[0][0] if values and values[0] else 0.0
        yield "wider", pa.array([[*value, first] for value in values])
        yield "ragged", pa.array([value[: 1 + place % 2] for place, value in enumerate(values)])
        yield "an empty entry", pa.array([[None, *value[1:]] for value in values])
        yield "one number", pa.array([0.5] * len(values))
        if isinstance(first, float):
            yield "a nan", pa.array([[math.nan] * len(values[0]), *values[1:]], kind)
    else:
        yield "lists", pa.array([[value, value] for value in values])
    if pa.types.is_integer(kind):
        yield "negative", pa.array([-1 - value for value in values], kind)
        yield "huge", pa.array([2**62 + value for value in values], kind)
        yield "fractions", pa.array([value + 0.5 for value in values])
    if pa.types.is_floating(kind):
        yield "a nan", pa.array([math.nan, *values[1:]], kind)
        yield "infinite", pa.array([math.inf] * len(values), kind)
    if pa.types.is_boolean(kind) or pa.types.is_string(kind):
        yield "numbers", pa.array([0.5] * len(values))


def _of_json(path: Path, name: str) -> Iterator[Damage]:
    document = json.loads(path.read_bytes())
    for keys in _fields(document):
        field = ".".join(map(str, keys)) or "$"
        value = _at(document, keys)
        if keys and isinstance(keys[-1], str):
            yield Damage(name, field, "missing", lambda root, keys=keys: _write(root / name, document, keys, _MISSING))
        for new in JSON_VALUES:
            if new != value and (type(new) is not type(value) or isinstance(new, (int, float))):
                kind = f"{json.dumps(new)}"
                yield Damage(
                    name, field, kind, lambda root, keys=keys, new=new: _write(root / name, document, keys, new)
                )


_MISSING = object()


def _fields(value: Any, keys: tuple = ()) -> Iterator[tuple]:
    yield keys
    if isinstance(value, dict):
        for key, child in value.items():
            yield from _fields(child, (*keys, key))
    elif isinstance(value, list):
        for place, child in enumerate(value[:_LIST_ITEMS]):
            yield from _fields(child, (*keys, place))


def _at(document: Any, keys: tuple) -> Any:
    for key in keys:
        document = document[key]
    return document


def _write(path: Path, document: Any, keys: tuple, value: Any) -> None:
    changed = json.loads(json.dumps(document))
    if not keys:
        changed = value
    else:
        parent = _at(changed, keys[:-1])
        if value is _MISSING:
            del parent[keys[-1]]
        else:
            parent[keys[-1]] = value
    path.write_text(json.dumps(changed), encoding="utf-8")


def copy_of(root: Path, target: Path) -> Path:
    """A copy of a data set to damage, in the place of an earlier one."""
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(root, target)
    return target


def harmless(damage: Damage) -> bool:
    """Whether a data set can still be used: documents about it, statistics of single episodes, quantiles, free entries
    of the right type."""
    if damage.file == "meta/info.json":
        unnamed = damage.field.endswith(".names") and not damage.field.startswith(("features.action", "features.obs"))
        return unnamed or damage.field.endswith(_FREE_ENTRIES) or (damage.field, damage.kind) in _FREE_INFO
    if damage.file == "meta/stats.json":
        # Other numbers than those of the frames are a warning, unless they are far off.
        return any(f".{name}" in damage.field for name in _QUANTILES) or damage.kind in ("-1", "1.5", "true")
    if damage.file.startswith("meta/episodes"):
        if damage.field.startswith(("stats/", "meta/episodes/")):
            return True
        if (damage.field, damage.kind) == ("tasks", "wider"):
            return True  # the sentence twice
        empty = damage.field in _MEASURED and damage.kind in ("one empty value", "all empty", "no type")
        return empty or (damage.field in _FREE_COLUMNS and damage.kind in ("negative", "huge", "a nan", "infinite"))
    return damage.file.startswith("meta/copolicy")


def unused_in_training(damage: Damage) -> bool:
    """Whether training does not read what was damaged: documents, names of numbers, what is known of an episode."""
    if damage.file.startswith("meta/episodes"):
        return damage.field in EPISODE_COLUMNS
    if damage.file == "meta/stats.json" and damage.kind == "NaN":
        return damage.field.startswith(
            ("frame_index", "episode_index", "index", "task_index", "next.done", "next.succ")
        )
    return ".names" in damage.field or damage.file.startswith("meta/copolicy")


def look_before_training(root: Path) -> None:
    """What `copolicy-train` looks at before the first step, all episodes being chosen.

    Raises:
        CopolicyError: the data set cannot be trained on.
    """
    from copolicy.dataset.lerobot_folder.info import read_info
    from copolicy.dataset.lerobot_folder.loading import read_frame_statistics
    from copolicy.train.episode_choice import check_local_dataset
    from copolicy.train.finite_data import replacement_statistics, require_finite_frames

    check_local_dataset(root)
    info = read_info(root)
    require_finite_frames(root, None, info["features"])
    episodes = range(info["total_episodes"])
    replacement_statistics(root, read_frame_statistics(root), episodes, len(episodes))


_QUANTILES = ("q01", "q10", "q50", "q90", "q99")
_MEASURED = ("achieved_hz", "replay_drift_px", "obstacle_size")
_FREE_COLUMNS = ("achieved_hz", "replay_drift_px", "seed", "late_ticks")
_FREE_ENTRIES = (".hold", ".record_hz", "robot_type", "video_path", "video_files_size_in_mb", "data_files_size_in_mb")
_FREE_INFO = {
    *((name, "missing") for name in ("chunks_size", "data_path", "splits", "splits.train")),
    *(("splits", kind) for kind in ("null", "{}")),
    ("chunks_size", "1.5"),
}
