"""Trajectories beside a result are the episodes that were run."""

import json

import numpy as np
import pytest
from test_eval_partner import MAPS, ROBOTS

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.task import get_task
from copolicy.evaluate.partner_study.study import run_with_partners
from copolicy.evaluate.trajectories import demonstrations, read_trajectories, trajectories_beside, write_trajectories
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
