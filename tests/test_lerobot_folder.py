"""Errors of every command for a folder that is not a data set of this task."""

import json
import shutil

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from checked_data import EPISODES, make_data_set, make_recordings, set_columns

from copolicy.cards.cli import main as cards
from copolicy.convert.cli import main as convert
from copolicy.dataset.cli import main as dataset
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.lerobot_folder.folder import LeRobotFolder
from copolicy.dataset.lerobot_folder.info import split_range
from copolicy.dataset.lerobot_folder.loading import require_loadable

COMMANDS = {
    "check": (dataset, "check", "ROOT"),
    "stats": (dataset, "stats", "ROOT"),
    "exclude": (dataset, "exclude", "ROOT", "--list"),
    "release": (dataset, "release", "ROOT", "--bump", "major", "--notes", "n"),
    "card": (cards, "dataset", "ROOT", "--repo-id", "lab/table"),
    "report": (cards, "report", "ROOT"),
    "zarr": (convert, "export", "ROOT", "--format", "zarr", "--out", "OUT.zarr"),
    "robomimic": (convert, "export", "ROOT", "--format", "robomimic", "--out", "OUT.hdf5"),
    "minari": (convert, "export", "ROOT", "--format", "minari", "--out", "OUT-v0"),
    "merge": (convert, "merge", "ROOT", "SOUND", "--out", "OUT", "--repo-id", "lab/merged"),
}


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    return make_recordings(tmp_path_factory.mktemp("recordings"), episodes=2)


@pytest.fixture(scope="module")
def sound(recordings, tmp_path_factory):
    return make_data_set(recordings, tmp_path_factory.mktemp("sound") / "table")


@pytest.fixture
def root(sound, tmp_path):
    shutil.copytree(sound, tmp_path / "table")
    return tmp_path / "table"


@pytest.fixture
def refused(sound, tmp_path, capsys):
    """The single line of a command's error."""

    def run(name, root) -> str:
        main, *arguments = COMMANDS[name]
        replaced = {"ROOT": str(root), "SOUND": str(sound)}
        flags = [replaced.get(flag, flag.replace("OUT", str(tmp_path / "out"))) for flag in arguments]
        assert main(flags) == 2
        (line,) = capsys.readouterr().err.strip().splitlines()
        return line

    return run


def older_set(root):
    """A data set as LeRobot 0.3 wrote it, with JSON lines instead of a table of episodes."""
    root.joinpath("meta").mkdir(parents=True)
    info = {"codebase_version": "v2.1", "fps": 10, "features": {}, "total_episodes": 1, "total_chunks": 1}
    (root / "meta/info.json").write_text(json.dumps(info), encoding="utf-8")
    (root / "meta/episodes.jsonl").write_text('{"episode_index": 0}\n', encoding="utf-8")
    return root


def empty_set(root):
    """A data set as LeRobot creates it before the first episode."""
    root.joinpath("meta").mkdir(parents=True)
    info = {
        "codebase_version": "v3.0", "fps": 10, "features": {"action": {"dtype": "float32", "shape": [4]}},
        "total_episodes": 0, "total_frames": 0, "total_tasks": 0,
    }  # fmt: skip
    (root / "meta/info.json").write_text(json.dumps(info), encoding="utf-8")
    return root


def other_tasks_set(root, sound, state_shape=(40, 2)):
    """A sound set of another task: the same metadata, other frames."""
    shutil.copytree(sound, root)
    info = json.loads((root / "meta/info.json").read_bytes())
    numbers = [name for name in info["features"] if name in ("timestamp", "index") or name.endswith("_index")]
    features = {"observation.state": {"dtype": "float32", "shape": list(state_shape), "names": None}}
    info["features"] = {
        **features, "action": {"dtype": "float32", "shape": [7], "names": None},
        **{name: info["features"][name] for name in numbers},
    }  # fmt: skip
    (root / "meta/info.json").write_text(json.dumps(info), encoding="utf-8")
    path = root / "data/chunk-000/file-000.parquet"
    table = pq.read_table(path).select(numbers)
    rows = table.num_rows
    table = table.append_column("action", pa.array(np.zeros((rows, 7), np.float32).tolist()))
    pq.write_table(table.append_column("observation.state", pa.array(np.zeros((rows, *state_shape)).tolist())), path)
    stats = json.loads((root / "meta/stats.json").read_bytes())
    for name, width in (("action", 7), ("observation.state", int(np.prod(state_shape)))):
        stats[name] = {kind: [1.0] * (1 if kind == "count" else width) for kind in stats["timestamp"]}
    (root / "meta/stats.json").write_text(json.dumps(stats), encoding="utf-8")
    return root


@pytest.mark.parametrize("name", COMMANDS)
def test_format_v21_is_refused_with_the_conversion_command(name, tmp_path, refused):
    line = refused(name, older_set(tmp_path / "older"))
    assert "v2.1" in line
    assert "convert_dataset_v21_to_v30" in line


@pytest.mark.parametrize("name", COMMANDS)
def test_a_set_without_episodes_is_refused(name, tmp_path, refused):
    assert "found an empty one" in refused(name, empty_set(tmp_path / "empty"))


@pytest.mark.parametrize("name", [name for name in COMMANDS if name not in ("exclude", "release", "merge")])
def test_a_sound_set_of_another_task_is_refused(name, tmp_path, sound, refused):
    line = refused(name, other_tasks_set(tmp_path / "other", sound))
    assert "one of another task: observation.state of shape (40, 2) instead of (7,)" in line


def test_training_takes_a_sound_set_of_another_task(tmp_path, sound):
    require_loadable(other_tasks_set(tmp_path / "other", sound, (9,)))


@pytest.mark.parametrize("name", [name for name in COMMANDS if name != "check"])
def test_a_folder_of_recordings_is_refused_with_the_command_for_it(name, recordings, refused):
    assert "found a folder of recordings (copolicy-convert mcap reads it)" in refused(name, recordings)


@pytest.mark.parametrize(
    ("entry", "value", "found"),
    [
        ("fps", "10", "with int | float at $.fps, found str"),
        ("fps", 0, "with a positive fps, found 0"),
        ("features", [], "with object at $.features, found array"),
        ("features", {"action": 3}, "with object at $.features[...], found int"),
        ("total_episodes", None, "with int at $.total_episodes, found null"),
    ],
)
@pytest.mark.parametrize("name", ["check", "stats", "card", "zarr"])
def test_entries_of_another_type_are_refused_with_their_path(name, root, entry, value, found, refused):
    path = root / "meta/info.json"
    path.write_text(json.dumps({**json.loads(path.read_bytes()), entry: value}), encoding="utf-8")
    assert found in refused(name, root)


@pytest.mark.parametrize("name", ["check", "stats", "card", "zarr", "exclude"])
def test_a_null_length_is_refused(name, root, refused):
    set_columns(root, length=lambda values: [None, *values[1:]])
    assert "length" in refused(name, root)


def test_columns_of_texts_may_be_dictionaries_and_numbers_of_another_size(root):
    table = pq.ParquetFile(root / EPISODES).read()
    for name, kind in (
        ("map_id", pa.dictionary(pa.int32(), pa.string())),
        ("late_ticks", pa.int32()),
        ("duration_s", pa.float32()),
        ("length", pa.float64()),
        ("pair_id", pa.large_string()),
    ):
        place = table.column_names.index(name)
        table = table.set_column(place, name, table.column(name).combine_chunks().cast(kind))
    pq.write_table(table, root / EPISODES)
    rows = LeRobotFolder.open(root).rows()
    assert all(isinstance(row["length"], int) and isinstance(row["map_id"], str) for row in rows)


def test_nulls_become_unknown_values(root):
    set_columns(root, achieved_hz=[None, None], pair_id=[None, None])
    (row, _) = LeRobotFolder.open(root).rows(("achieved_hz", "pair_id"))
    assert np.isnan(row["achieved_hz"])
    assert row["pair_id"] == ""


def test_each_episode_once(root):
    set_columns(root, episode_index=[0, 0])
    with pytest.raises(FileFormatError, match="episodes 0 to 1, each once, found episode 0 twice"):
        LeRobotFolder.open(root)


def test_frames_are_read_by_episode(sound):
    folder = LeRobotFolder.open(sound)
    shapes = {"action": (4,), "index": (1,)}
    read = list(folder.frames(shapes))
    assert [number for number, _ in read] == list(range(len(folder.lengths)))
    assert [columns["action"].shape for _, columns in read] == [(length, 4) for length in folder.lengths]
    np.testing.assert_array_equal(
        np.concatenate([columns["index"] for _, columns in read]), np.arange(sum(folder.lengths))
    )


def _change_frames(root, change):
    (path,) = (root / "data").rglob("*.parquet")
    pq.write_table(change(pq.read_table(path)), path)


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (lambda table: table.slice(1), r"expected episode 0 with \d+ frames as in meta/episodes, found episode 0 with"),
        (
            lambda table: pa.concat_tables([table, table.slice(0, 1)]),
            "expected no further episode as in meta/episodes, found",
        ),
        (lambda table: table.filter(pc.field("episode_index") == 0), "expected the frames of episode 1"),
        (lambda table: table.drop_columns("next.reward"), "none named next.reward"),
    ],
)
def test_frames_that_disagree_with_the_episodes_are_refused(root, change, found):
    _change_frames(root, change)
    with pytest.raises(FileFormatError, match=found):
        list(LeRobotFolder.open(root).frames({"next.reward": (1,)}))


def test_frames_are_finite(root):
    def with_nan(table):
        values = table["next.reward"].to_pylist()
        values[3] = float("nan")
        place = table.column_names.index("next.reward")
        return table.set_column(place, "next.reward", pa.array(values, pa.float32()))

    _change_frames(root, with_nan)
    with pytest.raises(FileFormatError, match=r"expected finite next.reward, found nan or inf"):
        list(LeRobotFolder.open(root).frames({"next.reward": (1,)}))


@pytest.mark.parametrize(
    ("text", "span"),
    [
        ("0:40", range(40)),
        ("7:7", range(7, 7)),
        ("5:2", range(5, 2)),
        ("0-40", None),
        (":3", None),
        ("1:2:3", None),
        ("-1:2", None),
    ],
)
def test_a_split_is_a_range_of_episodes(text, span):
    assert split_range(text) == span


def test_invalid_splits_are_refused(root):
    path = root / "meta" / "info.json"
    info = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**info, "splits": {"train": "0:1", "test": "1-2"}}), encoding="utf-8")
    with pytest.raises(FileFormatError, match="expected splits as FIRST:END, found '1-2'"):
        _ = LeRobotFolder.open(root).splits
    path.write_text(json.dumps({**info, "splits": {"train": "0:1", "test": "1:2"}}), encoding="utf-8")
    assert LeRobotFolder.open(root).splits == {"train": range(1), "test": range(1, 2)}
