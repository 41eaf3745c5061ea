"""Everything that `copolicy-convert` does, on a second task."""

import json
from pathlib import Path
from typing import Any

import gymnasium
import h5py
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from peg_data import convert_pegs, record_pegs

import lerobot_policy_copolicy  # noqa: F401 - registers the environment
from copolicy.convert.cli import main
from copolicy.convert.export.source import ExportSource
from copolicy.convert.upstream.zarr_arrays import ZarrArrays
from copolicy.dataset.features import PAIR_GYM_ID
from copolicy.dataset.versions.content import read_content


@pytest.fixture
def recordings(peg, tmp_path) -> Path:
    return record_pegs(tmp_path / "recordings")


@pytest.fixture
def peg_set(recordings, tmp_path) -> Path:
    return convert_pegs(recordings, tmp_path / "set")


def run(capsys, *arguments: object) -> dict:
    capsys.readouterr()
    assert main([*map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_the_final_state_follows_from_the_last_action(peg, peg_set):
    episodes = list(ExportSource.open(peg_set).episodes())
    assert len(episodes) == 4
    for episode in episodes:
        assert abs(episode.final_state()[0] - episode.environment[1]) < 0.05  # close to the mark
        assert episode.next_states().shape == episode.states.shape == (len(episode), 2)


def test_a_store_has_the_names_of_the_task(peg_set, tmp_path, capsys):
    out = tmp_path / "peg.zarr"
    summary = run(capsys, "export", peg_set, "--format", "zarr", "--out", out)
    obs, actions = ZarrArrays(out, "data/obs").read("data/obs"), ZarrArrays(out, "data/obs").read("data/action")
    assert (obs.shape, actions.shape) == ((summary["rows"], 4), (summary["rows"], 2))
    attributes = json.loads((out / ".zattrs").read_text(encoding="utf-8"))
    assert attributes["obs"] == ["position", "velocity", "start", "mark"]
    assert attributes["action"] == ["robot_push", "human_push"]
    assert attributes["format_of_origin"] == "LeRobot v3, copolicy pushing a peg"


def test_the_layout_of_the_original_is_for_its_own_task(peg_set, tmp_path, capsys):
    out = tmp_path / "peg.zarr"
    assert main(["export", str(peg_set), "--format", "zarr", "--out", str(out), "--alignment", "upstream"]) == 2
    error = capsys.readouterr().err
    assert "--alignment: expected ours: upstream is the layout of the original program, whose task is 'table'" in error
    assert not out.exists()


def test_robomimic_names_the_environment_of_the_task(peg_set, tmp_path, capsys):
    out = tmp_path / "peg.hdf5"
    run(capsys, "export", peg_set, "--format", "robomimic", "--out", out, "--valid", 0.3, "--valid-by", "episodes")
    with h5py.File(out) as opened:
        file: Any = opened
        demo = file["data/demo_0"]
        count = demo.attrs["num_samples"]
        assert demo["obs/agent_pos"].shape == demo["next_obs/agent_pos"].shape == (count, 2)
        assert np.array_equal(demo["next_obs/human_action"][()], demo["actions"][:, 1:])
        environment = json.loads(file["data"].attrs["env_args"])
        assert set(file["mask"]) >= {"train", "valid", "success"}
    assert (environment["env_name"], environment["env_kwargs"]) == (PAIR_GYM_ID, {"fps": 10, "task": "peg"})


def test_minari_recovers_the_environment_of_the_task(peg_set, tmp_path, capsys):
    out = tmp_path / "peg-v0"
    run(capsys, "export", peg_set, "--format", "minari", "--out", out)
    metadata = json.loads((out / "data/metadata.json").read_text(encoding="utf-8"))
    assert metadata["description"] == "Push the peg to the mark together. Two players; sources: simulated."
    assert metadata["requirements"] == ["lerobot_policy_copolicy[train]", "lab_peg"]
    environment = gymnasium.make(EnvSpec.from_json(metadata["env_spec"]))
    assert environment.spec is not None
    assert environment.spec.max_episode_steps == 100
    with h5py.File(out / "data/main_data.hdf5") as opened:
        file: Any = opened
        group = file["episode_0"]
        observation = {name: values[0] for name, values in group["observations"].items()}
        assert environment.observation_space.contains(observation)
        assert environment.action_space.contains(group["actions"][0])
        assert group["terminations"][-1]
        assert len(group["observations/agent_pos"]) == len(group["actions"]) + 1


def test_settings_that_all_episodes_share_go_to_the_environment(peg):
    assert peg.environment({"step_limit": 90, "push": 0.5}) == (
        PAIR_GYM_ID, {"task": "peg", "step_limit": 90, "settings": {"push": 0.5}},
    )  # fmt: skip


def test_sets_grow_and_join(recordings, peg_set, tmp_path, capsys):
    more = record_pegs(tmp_path / "more", 2, 7, "left")
    added = run(capsys, "mcap", more, "--out", peg_set, "--repo-id", "lab/peg", "--append", "--license", "cc0-1.0")
    assert (added["episodes_added"], added["episodes"]) == (2, 6)
    first, second = convert_pegs(recordings, tmp_path / "a"), convert_pegs(more, tmp_path / "b")
    merged = run(capsys, "merge", first, second, "--out", tmp_path / "whole", "--repo-id", "lab/whole")
    assert (merged["episodes"], merged["content_hash"]) == (6, read_content(peg_set).hash)


def test_shards_give_the_set_of_one_conversion(recordings, peg_set, tmp_path, capsys):
    sharded = tmp_path / "whole"
    call = ("mcap", recordings, "--out", sharded, "--repo-id", "lab/peg", "--license", "cc0-1.0", "--shard-episodes", 3)
    summary = run(capsys, *call)
    assert (summary["shards"], summary["episodes"]) == (2, 4)
    assert read_content(sharded).hash == read_content(peg_set).hash


def test_rates_are_held_against_the_rate_of_the_recordings(recordings, tmp_path, capsys):
    for flags in ((), ("--shard-episodes", "2")):
        call = ["mcap", str(recordings), "--out", str(tmp_path / "odd"), "--repo-id", "lab/peg", "--fps", "15", *flags]
        assert main(call) == 2
        assert "fps: expected a divisor of 20 [1, 2, 4, 5, 10, 20], found 15" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["recordings"]
