import json
import subprocess
import sys
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from copolicy.convert.lerobot.prepare import Conversion, prepare_episode
from copolicy.convert.lerobot.writer import write_dataset
from copolicy.dataset.episode import EPISODE_COLUMNS, Episode, EpisodeMeta
from copolicy.dataset.exceptions import OutputExistsError, RunError
from copolicy.dataset.lerobot_folder.info import robot_type
from copolicy.dataset.task import get_task
from copolicy.tasks.table.features import FEATURES, TASK
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.world import TableWorld


def play(index: int, steps: int) -> Episode:
    """Random forces on the map of this number."""
    config = MAP_SETS["training"][index]
    world = TableWorld(config)
    actions = np.random.default_rng(index).uniform(-1, 1, (steps, 4))
    states = [world.observation]
    for action in actions:
        world.step(action)
        states.append(world.observation)
    meta = EpisodeMeta(
        f"uuid-{index}", pair_id=f"pair-{index % 2}", success=index % 2 == 0, seed=index, duration_s=steps / 30
    )
    return Episode(np.array(states[:-1]), actions, states[-1], meta, config, notes=(f"note {index}",))


def prepared(count: int, fps: int = 10, steps: int = 40):
    return [
        prepare_episode(play(index, steps + 7 * index), Conversion(fps, license="CC-BY-4.0")) for index in range(count)
    ]


def write(episodes, root, fps=10, **options):
    return write_dataset(episodes, root, "me/table", fps, "mean", lambda: {"converter": "test"}, **options)


def load(root, **options) -> Any:
    return LeRobotDataset("me/table", root=root, **options)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A data set of five episodes by us, the same by LeRobot's own calls, and our episodes."""
    folder = tmp_path_factory.mktemp("sets")
    episodes = prepared(5)
    write(episodes, folder / "ours")
    theirs = LeRobotDataset.create(
        "me/table", 10, FEATURES, folder / "theirs", robot_type=robot_type("table"), use_videos=False
    )
    for episode in episodes:
        shaped = {name: column.reshape(-1, *FEATURES[name]["shape"]) for name, column in episode.columns.items()}
        for frame in range(episode.frames):
            theirs.add_frame({"task": TASK, **{name: column[frame] for name, column in shaped.items()}})
        theirs.save_episode()
    theirs.finalize()
    return folder / "ours", folder / "theirs", episodes


def test_rows_are_those_of_add_frame(written):
    ours, theirs = (pq.read_table(root / "data/chunk-000/file-000.parquet") for root in written[:2])
    assert ours.equals(theirs)
    ours_info, theirs_info = (json.loads(table.schema.metadata[b"huggingface"])["info"] for table in (ours, theirs))
    assert ours_info == theirs_info
    assert pq.ParquetFile(written[0] / "data/chunk-000/file-000.parquet").num_row_groups == 5


def test_the_information_is_that_of_add_frame(written):
    ours, theirs = (json.loads((root / "meta/info.json").read_text(encoding="utf-8")) for root in written[:2])
    assert ours["features"]["action"].pop("hold") == "mean"
    assert ours["features"]["action"].pop("record_hz") == 30
    assert ours == theirs
    assert pd.read_parquet(written[0] / "meta/tasks.parquet").equals(pd.read_parquet(written[1] / "meta/tasks.parquet"))


def test_the_episode_table_is_that_of_add_frame_and_our_columns(written):
    ours, theirs = (pq.read_table(root / "meta/episodes/chunk-000/file-000.parquet") for root in written[:2])
    assert set(ours.column_names) == set(theirs.column_names) | set(EPISODE_COLUMNS)
    for name in theirs.column_names:
        if name.startswith("stats/"):
            assert ours[name].type == theirs[name].type, name
        else:
            assert ours[name].to_pylist() == theirs[name].to_pylist(), name


def test_statistics_are_those_of_lerobot_where_it_is_precise(written):
    ours, theirs = (json.loads((root / "meta/stats.json").read_text(encoding="utf-8")) for root in written[:2])
    assert set(ours) == set(theirs)
    for name, expected in theirs.items():
        assert set(ours[name]) == set(expected)
        span = np.subtract(expected["max"], expected["min"])
        for statistic, value in expected.items():
            # Its squares in single precision blur deviations by up to a tenth of a pixel at 1000 px.
            tolerance = 0.2 if statistic == "std" and "state" in name else span / 1000 + 1e-4
            assert (np.abs(np.subtract(ours[name][statistic], value)) <= tolerance).all(), (name, statistic)
    frames = [episode.columns["observation.state"] for episode in written[2]]
    assert ours["observation.state"]["std"] == pytest.approx(np.concatenate(frames).astype(float).std(axis=0))


def test_it_loads_with_time_offsets_and_our_columns(written):
    root, _, episodes = written
    offsets = {"observation.state": [-0.2, -0.1, 0.0], "action": [step / 10 for step in range(12)]}
    dataset = load(root, delta_timestamps=offsets)
    assert (dataset.num_episodes, dataset.num_frames, dataset.fps) == (5, sum(e.frames for e in episodes), 10)
    item = dataset[episodes[0].frames + 4]  # the fifth frame of the second episode
    assert item["task"] == TASK
    assert torch.equal(item["observation.state"], torch.from_numpy(episodes[1].columns["observation.state"][2:5]))
    assert not item["observation.state_is_pad"].any()
    assert torch.equal(item["action"][:4], torch.from_numpy(episodes[1].columns["action"][4:8]))
    rows = dataset.meta.episodes
    for name in EPISODE_COLUMNS:
        expected = [getattr(episode.meta, name) for episode in episodes]
        assert rows[name] == ([None] * 5 if name == "achieved_hz" else expected)
    assert rows["license"] == ["CC-BY-4.0"] * 5
    assert max(rows["replay_drift_px"]) < 1e-9


def test_the_record_of_the_conversion(written):
    record = json.loads((written[0] / "meta/copolicy.json").read_text(encoding="utf-8"))
    notes = {f"uuid-{index}": [f"note {index}"] for index in range(5)}
    assert record.pop("task") == json.loads(json.dumps(get_task("table").spec.to_dict()))
    assert record == {"converter": "test", "fps": 10, "hold": "mean", "notes": notes}


def test_data_files_have_a_limit(tmp_path):
    write(prepared(40, fps=30, steps=400), tmp_path / "set", 30, data_file_mb=1)
    files = sorted((tmp_path / "set/data/chunk-000").iterdir())
    assert len(files) > 1
    dataset = load(tmp_path / "set")
    assert sorted(set(dataset.meta.episodes["data/file_index"])) == list(range(len(files)))
    last = dataset.meta.episodes[39]
    assert int(dataset[last["dataset_from_index"]]["episode_index"]) == 39
    assert dataset.num_frames == last["dataset_to_index"]


def test_an_episode_is_there_once(tmp_path):
    episodes = prepared(2)
    with pytest.raises(RunError) as error:
        write([*episodes, episodes[0]], tmp_path / "set")
    expected = "expected every episode once, found episode uuid-0 also in episode 0; nothing was written"
    assert str(error.value) == f"episode 2: {expected}"
    assert list(tmp_path.iterdir()) == []


def test_an_empty_set_is_none(tmp_path):
    with pytest.raises(RunError, match="expected at least one episode to write, found none"):
        write([], tmp_path / "set")
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / "set").mkdir()
    with pytest.raises(OutputExistsError):
        write(prepared(1), tmp_path / "set")
    assert list((tmp_path / "set").iterdir()) == []


def test_without_lerobot_the_extra_is_named():
    code = (
        "import sys; sys.modules['lerobot'] = None\n"
        "from copolicy.convert.cli import main\n"
        "from copolicy.dataset.exceptions import MissingExtraError\n"
        "try:\n    import copolicy.convert.lerobot.writer\n"
        "except MissingExtraError as error:\n    print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == (
        "lerobot is not installed: this command needs the extra, pip install 'lerobot_policy_copolicy[train]'"
    )
