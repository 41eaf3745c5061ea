"""What a notebook imports from a room: it is there, it is light, and it says the same as the commands."""

import json
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from checked_data import make_data_set, make_recordings

from copolicy.cards import DatasetFacts
from copolicy.collect import make_agent, run_episodes
from copolicy.convert import Conversion, append_recordings, convert_recordings, merge_datasets
from copolicy.dataset import check_dataset, dataset_statistics, load_dataset, read_episode
from copolicy.dataset.cli import main as dataset_command
from copolicy.dataset.exceptions import CopolicyError, FileFormatError, InvalidValueError, UnknownNameError
from copolicy.dataset.files.listing import distinct_files
from copolicy.evaluate import compare_episodes, coplan_episodes, success
from copolicy.evaluate.cli import main as evaluate

ROOMS = tuple(f"copolicy.{room}" for room in ("dataset", "collect", "convert", "train", "evaluate", "cards"))
HEAVY = ("torch", "lerobot", "datasets", "pandas", "matplotlib", "pymunk", "pygame", "scipy", "pyarrow")


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """Recordings in `raw`, the data set of them in `set`."""
    folder = tmp_path_factory.mktemp("interface")
    make_recordings(folder / "raw", 3, seed=5)
    make_data_set(folder / "raw", folder / "set", "--no-drift")
    return folder


@pytest.mark.parametrize("room", ROOMS)
def test_every_name_of_a_room_is_there(room):
    module = import_module(room)
    for name in module.__all__:
        assert getattr(module, name) is not None
    assert set(module.__all__) <= set(dir(module))
    assert not {"TYPE_CHECKING", "lazy_names"} & set(dir(module))
    with pytest.raises(AttributeError, match=f"module '{room}' has no attribute 'nonsense'"):
        module.nonsense  # noqa: B018


@pytest.mark.parametrize("room", ROOMS)
def test_importing_a_room_loads_nothing_heavy(room):
    code = f"import sys, {room}; print(*sorted(set(sys.modules) & {set(HEAVY)!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_a_data_set_is_what_its_files_say(made):
    dataset = load_dataset(made / "set")
    assert repr(dataset) == (
        f"PairDataset(set: 3 episodes of table carrying, {sum(map(len, dataset.episodes))} frames at 10 Hz, "
        "source: simulated)"
    )
    rows = pq.read_table(made / "set" / "data").to_pydict()
    of_first = [index for index, episode in enumerate(rows["episode_index"]) if episode == 0]
    first = dataset.episodes[0]
    for name, values in (
        ("observation.state", first.states), ("action", first.actions), ("next.reward", first.rewards),
        ("observation.human_action", first.past_human_actions),
    ):  # fmt: skip
        expected = np.array([rows[name][index] for index in of_first])
        np.testing.assert_array_equal(values, expected.reshape(values.shape))
    assert repr(first).startswith(f"DatasetEpisode(0, states=({len(first)}, 7), actions=({len(first)}, 4), map=train")
    assert dataset.splits == {"train": range(3)}
    assert dataset.table.column("episode_uuid").to_pylist() == [e.columns["episode_uuid"] for e in dataset.episodes]
    assert not [name for name in dataset.table.column_names if "/" in name]
    assert [episode.index for episode in dataset.episodes[1:]] == [1, 2]
    assert dataset.episodes[-1].index == 2


def test_iterating_and_indexing_give_the_same(made):
    streamed = list(load_dataset(made / "set").episodes)
    loaded = load_dataset(made / "set").episodes
    for index, episode in enumerate(streamed):
        np.testing.assert_array_equal(episode.states, loaded[index].states)
        assert episode.scenario == loaded[index].scenario
        assert episode.settings == loaded[index].settings


def test_a_data_set_that_is_none_is_one_line(made, tmp_path):
    with pytest.raises(FileFormatError, match=r"did you mean .*/set"):
        load_dataset(made / "sett")
    with pytest.raises(FileFormatError):
        load_dataset(made / "raw")
    with pytest.raises(InvalidValueError, match=r"revision: expected a data set on the Hub, .* is a folder, found"):
        load_dataset(made / "set", "main")


def test_the_players_of_a_pair_do_again_what_was_recorded(made):
    for path in distinct_files(made / "raw", "*.mcap"):
        recorded = read_episode(path)
        meta = recorded.meta
        name = f"scripted:{meta.pair_id}"
        (again,) = run_episodes(name, name, [recorded.scenario], seed=meta.seed)
        np.testing.assert_array_equal(again.states, recorded.states)
        np.testing.assert_array_equal(again.final_state, recorded.final_state)
        np.testing.assert_array_equal(again.actions, recorded.actions)
        assert (again.meta.success, again.meta.termination_reason) == (meta.success, meta.termination_reason)
        assert again.meta.duration_s == pytest.approx(meta.duration_s, abs=1e-9)
        assert again.meta.map_id == meta.map_id
        replayed = run_episodes(f"replay:{path}", f"replay:{path}", [recorded.scenario])[0]
        np.testing.assert_array_equal(replayed.states, recorded.states)


def test_nothing_never_acts_and_a_partner_sits_at_its_own_seat():
    (episode,) = run_episodes("nothing", "scripted:stubborn", limit=1)
    assert not episode.actions[:, :2].any()
    assert episode.actions[:, 2:].any()
    assert (episode.meta.controller_0, episode.meta.controller_1) == ("nothing", "scripted:stubborn")
    with pytest.raises(InvalidValueError, match="scripted:stubborn: expected the human's seat, found 'seat 0'"):
        run_episodes("scripted:stubborn", "nothing", limit=1)
    with pytest.raises(InvalidValueError, match="scripted:never-yields: expected the robot's seat, found 'seat 1'"):
        run_episodes("nothing", "scripted:never-yields", limit=1)


@pytest.mark.parametrize(
    ("name", "settings", "error", "said"),
    [
        ("robot", {}, UnknownNameError, "unknown agent 'robot'; available: nothing, policy, replay, scripted"),
        ("scripted", {}, InvalidValueError, "agent: expected scripted:S01, found 'scripted'"),
        ("scripted:nobody", {}, UnknownNameError, "unknown simulated player 'nobody'; available: S01"),
        ("policy:", {}, InvalidValueError, "agent: expected policy:pretrained, found 'policy:'"),
        ("policy:no/such", {}, FileFormatError, "no/such: expected a checkpoint folder"),
        ("replay:no.mcap", {}, CopolicyError, "no.mcap"),
        ("nothing", {"speed": 1}, InvalidValueError, "nothing: expected no settings, found 'speed'"),
        ("scripted:S01", {"speed": 1}, InvalidValueError, "scripted:S01: expected no such setting, found 'speed'"),
    ],
)
def test_an_agent_that_is_none_is_one_line(name, settings, error, said):
    with pytest.raises(error) as caught:
        make_agent(name, **settings)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_call_without_sense_is_refused():
    agent = make_agent("nothing")
    with pytest.raises(InvalidValueError, match="human: expected another agent than the robot's, found 'nothing'"):
        run_episodes(agent, agent)
    with pytest.raises(InvalidValueError, match="limit: expected at least 1, found 0"):
        run_episodes("nothing", "nothing", limit=0)
    with pytest.raises(InvalidValueError, match="maps: expected at least one, found 'none'"):
        run_episodes("nothing", "nothing", [])
    with pytest.raises(UnknownNameError, match="unknown map set 'moon'"):
        run_episodes("nothing", "nothing", "moon")
    with pytest.raises(InvalidValueError, match="robot: expected a policy, which acts for both players"):
        run_episodes("nothing", None)


def test_co_planning_is_that_of_the_command(tmp_path):
    out = tmp_path / "eval.json"
    flags = ["--maps", "unseen", "--limit", "2", "--seed", "4", "--out", str(out)]
    assert evaluate(["coplan", "--policy", "pretrained", *flags]) == 0
    stored = json.loads(out.read_text(encoding="utf-8"))
    episodes = coplan_episodes("pretrained", "unseen", limit=2, seed=4)
    assert success(episodes) == stored["summary"]["success"]
    for row, episode in zip(stored["episodes"], episodes, strict=True):
        assert (row["success"], row["reason"]) == (episode.meta.success, episode.meta.termination_reason)
        assert (row["map_id"], row["steps"]) == (episode.meta.map_id, len(episode.actions))
    again = coplan_episodes("pretrained", "unseen", limit=2, seed=5)
    difference = compare_episodes(episodes, again)
    expected = np.mean(
        [one.meta.duration_s - other.meta.duration_s for one, other in zip(episodes, again, strict=True)]
    )
    assert difference["time_s"]["mean"] == pytest.approx(expected)
    force = np.mean([row["interaction_mean"] for row in stored["episodes"]])
    still = compare_episodes(episodes, run_episodes("nothing", "scripted:stubborn", "unseen", limit=2))
    assert difference["interaction_mean"]["pairs"] == 2
    assert still["interaction_mean"]["mean"] < force
    assert set(difference) == {"success", "time_s", "interaction_mean", "interaction_p95"}


def test_studies_without_sense_are_refused():
    with pytest.raises(InvalidValueError, match="episodes: expected at least one, found 'none'"):
        success([])
    (one,) = run_episodes("nothing", "nothing", "holdout", limit=1)
    (other,) = run_episodes("nothing", "nothing", "unseen", limit=1)
    with pytest.raises(InvalidValueError, match="second: expected the 1 starts of the first, in order"):
        compare_episodes([one], [other])
    with pytest.raises(InvalidValueError, match=r"n_action_steps: expected 1 to [0-9]+, the actions of a chunk"):
        coplan_episodes(n_action_steps=99, limit=1)


def test_a_folder_may_be_a_text(made, tmp_path):
    raw, made_set, out = str(made / "raw"), str(made / "set"), str(tmp_path / "out")
    assert check_dataset(made_set, made_set).findings == check_dataset(made / "set", made / "set").findings
    assert len(DatasetFacts.read(made_set).episodes) == 3
    assert convert_recordings([raw], out, "me/out", Conversion(drift=False))["episodes"] == 3
    assert append_recordings([raw], out, "me/out", Conversion(drift=False))["already_there"] == 3
    with pytest.raises(InvalidValueError, match=r"folders: expected a list of folders, found '.*raw'"):
        convert_recordings(raw, str(tmp_path / "other"), "me/out", Conversion())
    with pytest.raises(FileFormatError):  # the two sets share their episodes
        merge_datasets([made_set, out], str(tmp_path / "merged"), "me/out")
    with pytest.raises(InvalidValueError, match="downsampling: expected mean or first, found 'last'"):
        Conversion(downsampling="last")  # pyright: ignore[reportArgumentType]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_statistics_are_those_of_the_command(made, tmp_path):
    assert dataset_command(["stats", str(made / "set"), "--seed", "3", "--out", str(tmp_path / "stats.json")]) == 0
    document = dataset_statistics(str(made / "set"), seed=3)
    assert json.loads((tmp_path / "stats.json").read_text(encoding="utf-8")) == json.loads(json.dumps(document))
    with pytest.raises(FileFormatError, match="no-such-set"):
        dataset_statistics(tmp_path / "no-such-set")
