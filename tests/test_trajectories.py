"""Trajectories beside a result are the episodes that were run."""

import errno
import json
import os

import numpy as np
import pytest
from test_eval_partner import MAPS, ROBOTS

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.task import get_task
from copolicy.evaluate.partner_study.study import run_with_partners
from copolicy.evaluate.trajectories import (
    demonstrations,
    read_trajectories,
    trajectories_beside,
    write_result,
    write_trajectories,
)
from copolicy.tasks.table.physics import Physics


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A file of four episodes, and the episodes."""
    episodes = run_with_partners(ROBOTS["never-yields"], MAPS[:2], ["stubborn", "erratic"], Physics(step_limit=40))
    path = tmp_path_factory.mktemp("study") / "result.trajectories.parquet"
    write_trajectories(path, get_task(), "simulated", [("never-yields", episode) for episode in episodes])
    return path, episodes


def test_what_is_read_is_what_was_run(written):
    path, episodes = written
    task, label, trajectories = read_trajectories(path)
    assert (task.spec.name, label) == ("table", "simulated")
    assert len(trajectories) == len(episodes) == 4
    for read, run in zip(trajectories, episodes, strict=True):
        np.testing.assert_allclose(read.every_state, run.states, rtol=1e-6)
        np.testing.assert_allclose(read.actions, run.actions, rtol=1e-6)
        assert len(read.states) == len(read.actions) == run.steps
        assert read.columns == {"robot": "never-yields", **json.loads(json.dumps(run.to_json()))}
        assert read.scenario == run.scenario
        assert read.fps == 30


def test_a_result_leads_to_its_trajectories(written, tmp_path):
    path, _ = written
    assert trajectories_beside(path.parent / "result.json") == path
    assert len(read_trajectories(path.parent / "result.json").episodes) == 4
    with pytest.raises(
        FileFormatError, match=r"none\.trajectories\.parquet: expected the trajectories .* no such file"
    ):
        read_trajectories(tmp_path / "none.json")


def test_another_file_is_one_line(written, tmp_path, random_table):
    path, _ = written
    (other,) = (random_table / "data").rglob("*.parquet")
    half = tmp_path / "half.trajectories.parquet"
    half.write_bytes(path.read_bytes()[:-100])
    for file in (other, half):
        with pytest.raises(FileFormatError, match=r"expected the trajectories of a study \(--trajectories"):
            read_trajectories(file)


def test_demonstrations_leave_out_excluded_episodes(unsharded, tmp_path):
    import shutil

    from copolicy.dataset.lerobot_folder.exclusions import exclude

    _, label, episodes = demonstrations(unsharded / "whole")
    assert label == "demonstrations, source: simulated"
    assert episodes[0].final_state is None
    assert len(episodes[0].states) == len(episodes[0].actions)
    copy = shutil.copytree(unsharded / "whole", tmp_path / "copy")
    exclude(copy, ["1"], "test")
    remaining = demonstrations(copy).episodes
    assert len(remaining) == len(episodes) - 1
    np.testing.assert_array_equal(remaining[1].states, episodes[2].states)


@pytest.fixture
def earlier(written, tmp_path):
    """A result with the trajectories of four episodes, and a function that replaces it by one of other episodes."""
    _, episodes = written
    path = tmp_path / "result.json"

    def write(result, episodes):
        named = None if episodes is None else [("never-yields", episode) for episode in episodes]
        write_result(path, {"of": result}, get_task(), "simulated", named)

    write("earlier", episodes)
    return path, lambda result="new", count=1: write(result, None if count is None else episodes[:count])


def of(path):
    """Which result there is, and the number of episodes of the trajectories beside it."""
    result = json.loads(path.read_text(encoding="utf-8"))["of"] if path.exists() else None
    beside = trajectories_beside(path)
    return result, len(read_trajectories(beside).episodes) if beside.exists() else None


def test_a_result_without_trajectories_leaves_none_of_an_earlier_one(earlier):
    path, write = earlier
    assert of(path) == ("earlier", 4)
    write()
    assert of(path) == ("new", 1)
    write(count=None)
    assert of(path) == ("new", None)


def test_a_full_disk_leaves_the_earlier_result_with_its_trajectories(earlier, monkeypatch):
    import pyarrow.parquet as pq

    path, write = earlier

    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(pq, "write_table", full)
    with pytest.raises(OSError, match="No space left on device"):
        write()
    assert of(path) == ("earlier", 4)
    assert len(list(path.parent.iterdir())) == 2


@pytest.mark.parametrize("renames", [0, 1])
def test_a_killed_process_leaves_no_result_beside_trajectories_of_other_episodes(earlier, monkeypatch, renames):
    """The process ends before its first rename, or between that of the trajectories and that of the result."""
    path, write = earlier
    replace, done = os.replace, []

    def killed(*arguments):
        if len(done) == renames:
            raise KeyboardInterrupt
        done.append(replace(*arguments))

    monkeypatch.setattr(os, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        write()
    assert of(path) == (None, 1 if renames else 4)
