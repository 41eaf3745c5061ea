import hashlib
import json
import math
import shutil
import struct
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from versioned_data_set import (
    EPISODES,
    FRAMES,
    change_json,
    change_table,
    cut_differently,
    keep_episodes,
    set_value,
    simulated_data_set,
)

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.json_file import convert_json as as_type
from copolicy.dataset.lerobot_folder.exclusions import exclude
from copolicy.dataset.versions.content import read_content
from copolicy.dataset.versions.digests import Content, EpisodeContent, digest, encode


@pytest.fixture(scope="module")
def converted(tmp_path_factory) -> Path:
    return simulated_data_set(tmp_path_factory.mktemp("content") / "table")


@pytest.fixture
def dataset(converted, tmp_path) -> Path:
    """A copy that a test may change."""
    return Path(shutil.copytree(converted, tmp_path / "table"))


def test_different_values_have_different_bytes():
    values = [
        None, True, False, 0, 1, -1, 10, 1.0, 0.0, -0.0, math.inf, "", "1", "1.0", b"", b"1", [], [[]], [None], {},
        ["a", "b"], ["ab"], ["a", ["b"]], {"a": 1}, {"a": {"b": 1}}, {"a": None}, [1, 2], [12], "None", ["", "a"],
    ]  # fmt: skip
    assert len({encode(value) for value in values}) == len(values)


def test_equal_values_have_the_same_bytes():
    other_nan = struct.unpack("<d", struct.pack("<Q", 0x7FF8000000000123))[0]
    assert encode({"b": 1, "a": (1, 2)}) == encode({"a": [1, 2], "b": 1})
    assert encode(other_nan) == encode(math.nan)
    with pytest.raises(InvalidValueError, match=r"a value of the data set: expected text, number, .* found \{1\}"):
        encode({1})  # type: ignore[arg-type]


def test_the_algorithm_is_the_documented_one():
    """Computed by hand from the docstrings; another value means another algorithm, which needs a new prefix."""
    episode = EpisodeContent("uuid", "0" * 64, 3, {}, {})
    content = Content(10, "table", {"action": {"dtype": "float32", "shape": [4]}}, ["Carry."], (episode,))
    features = b"d1:s6:actiond2:s5:dtypes7:float32s5:shapel1:i1:4"
    fields = [
        (b"s8:episodes", b"l1:s64:" + b"0" * 64),
        (b"s8:features", features),
        (b"s6:format", b"s18:copolicy-content-1"),
        (b"s3:fps", b"f" + struct.pack("<d", 10.0)),
        (b"s10:robot_type", b"s5:table"),
        (b"s5:tasks", b"l1:s6:Carry."),
    ]
    written = b"d6:" + b"".join(key + value for key, value in fields)
    assert content.hash == f"copolicy-content-1:sha256:{hashlib.sha256(written).hexdigest()}"
    assert digest(None) == hashlib.sha256(b"n").hexdigest()
    assert as_type(json.loads(json.dumps(asdict(content))), Content, "a content", "text") == content


def test_the_hash_ignores_the_storage_layout(dataset, converted):
    cut_differently(dataset)
    assert not (dataset / FRAMES).exists()
    assert read_content(dataset) == read_content(converted)


@pytest.mark.parametrize("kind", [pa.list_(pa.float32()), pa.large_list(pa.float32()), pa.list_(pa.float64())])
def test_the_hash_ignores_the_stored_number_type(dataset, converted, kind):
    def change(table: pa.Table) -> pa.Table:
        values = pa.array(table.column("action").to_pylist(), kind)
        return table.set_column(table.schema.get_field_index("action"), "action", values)

    change_table(dataset, FRAMES, change)
    assert read_content(dataset).hash == read_content(converted).hash


def test_the_hash_ignores_descriptions_and_derived_values(dataset, converted):
    (dataset / "README.md").write_text("other", encoding="utf-8")
    (dataset / "meta" / "stats.json").write_text("{}", encoding="utf-8")
    (dataset / "meta" / "copolicy.json").unlink()
    change_table(dataset, EPISODES, lambda table: table.drop([n for n in table.column_names if "stats/" in n]))
    assert read_content(dataset).hash == read_content(converted).hash


def _smallest_step(value: float) -> float:
    return float(np.nextafter(np.float32(value), np.float32(2)))


CHANGES = {
    "one bit of a state": lambda root: set_value(root, FRAMES, "observation.state[0]", 100, _smallest_step(300.0)),
    "the last frame's last force": lambda root: set_value(root, FRAMES, "action[3]", -1, 0.123),
    "a flag": lambda root: set_value(root, FRAMES, "next.success", 3, True),
    "a time": lambda root: set_value(root, FRAMES, "timestamp", 5, 0.75),
    "a frame number": lambda root: set_value(root, FRAMES, "frame_index", 5, 6),
    "a pair": lambda root: set_value(root, EPISODES, "pair_id", 2, "pair-9"),
    "a seed": lambda root: set_value(root, EPISODES, "seed", 2, 12345),
    "a missing drift": lambda root: set_value(root, EPISODES, "replay_drift_px", 2, None),
    "a name": lambda root: change_json(root, "meta/info.json", lambda i: i["features"]["action"].update(names=None)),
    "a hold": lambda root: change_json(root, "meta/info.json", lambda i: i["features"]["action"].update(hold="first")),
    "the rate": lambda root: change_json(root, "meta/info.json", lambda info: info.update(fps=15)),
    "the robot": lambda root: change_json(root, "meta/info.json", lambda info: info.update(robot_type="other")),
    "the task": lambda root: set_value(root, "meta/tasks.parquet", "task", 0, "Push."),
    "an exclusion": lambda root: exclude(root, ["2"], "stuck"),
    "an episode less": lambda root: keep_episodes(root, [0, 1, 2, 3, 4]),
    "another order": lambda root: keep_episodes(root, [1, 0, 2, 3, 4, 5]),
}


@pytest.mark.parametrize("change", CHANGES)
def test_every_other_change_changes_the_hash(dataset, converted, change):
    CHANGES[change](dataset)
    assert read_content(dataset).hash != read_content(converted).hash


def test_the_digest_of_an_episode_ignores_its_position(dataset, converted):
    keep_episodes(dataset, [5, 2])
    before = {episode.episode_uuid: episode for episode in read_content(converted).episodes}
    after = read_content(dataset).episodes
    assert len(after) == 2
    assert all(before[episode.episode_uuid] == episode for episode in after)


def test_a_task_is_hashed_by_its_sentence(dataset, converted):
    def renumber(table: pa.Table) -> pa.Table:
        return table.set_column(0, "task_index", pa.array([7], pa.int64()))

    change_table(dataset, "meta/tasks.parquet", renumber)
    with pytest.raises(FileFormatError, match=r"meta/tasks.parquet: expected task 0, found no such number"):
        read_content(dataset)

    def follow(table: pa.Table) -> pa.Table:
        position = table.schema.get_field_index("task_index")
        return table.set_column(position, "task_index", pa.array([7] * len(table), pa.int64()))

    change_table(dataset, FRAMES, follow)
    assert read_content(dataset).hash == read_content(converted).hash


DAMAGES = {
    "no data set with meta/info.json": (
        lambda root: (root / "meta" / "info.json").unlink(),
        r"table: expected a LeRobot v3 data set with meta/info.json, found a folder of other files",
    ),
    "older": (
        lambda root: change_json(root, "meta/info.json", lambda info: info.update(codebase_version="v2.1")),
        r"info.json: expected codebase_version v3.x, found v2.1",
    ),
    "no identifiers": (
        lambda root: change_table(root, EPISODES, lambda table: table.drop(["episode_uuid"])),
        r"meta/episodes: expected the episode columns of copolicy, found none named episode_uuid",
    ),
    "twice": (
        lambda root: change_table(root, EPISODES, lambda t: t.set_column(7, "episode_uuid", pa.array(["a"] * 6))),
        r"episodes: expected a unique episode_uuid for each episode, found 6 with 'a'",
    ),
    "a frame less": (
        lambda root: change_table(root, FRAMES, lambda table: table.slice(1)),
        r"data: expected frames with index 0 to \d+, each once, found others",
    ),
    "a frame elsewhere": (
        lambda root: set_value(root, FRAMES, "episode_index", 10, 1),
        r"data: expected frames in the episodes that meta/episodes names, found others",
    ),
    "a column less": (
        lambda root: change_table(root, FRAMES, lambda table: table.drop(["next.reward"])),
        r"expected the columns that meta/info.json names as features, found a difference in next.reward",
    ),
    "a value less": (
        lambda root: set_value(root, FRAMES, "next.reward", 10, None),
        r"expected a number in every row of next.reward, found nothing in row 10",
    ),
    "cut off": (
        lambda root: (root / FRAMES).write_bytes((root / FRAMES).read_bytes()[:-20]),
        r"data/chunk-000/file-000.parquet: expected a complete Parquet file, found Parquet magic bytes",
    ),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_inconsistent_data_sets_are_refused(dataset, damage):
    change, message = DAMAGES[damage]
    change(dataset)
    with pytest.raises(FileFormatError, match=message):
        read_content(dataset)
