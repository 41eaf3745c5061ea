"""Physics by episode: from the recording through data set, append, merge and check to exports; and what else mixes."""

import contextlib
import io
import json
import math
import shutil
from dataclasses import asdict
from pathlib import Path

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
from checked_data import EPISODES, FRAMES, make_data_set, set_columns, set_frames
from loaded_sets import load
from made_once import simulated

from copolicy.cards.cli import main as cards
from copolicy.collect.play.player import make_players, warn_other_settings
from copolicy.collect.play.settings import PlayerSpec
from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.collect.simulate.command import simulate
from copolicy.convert.cli import main
from copolicy.convert.export.source import ExportSource
from copolicy.convert.upstream.zarr_arrays import ZarrArrays
from copolicy.dataset.checks.checking import check_dataset
from copolicy.dataset.episode import LATER_COLUMNS, EpisodeMeta
from copolicy.dataset.recording.reader import read_episode
from copolicy.dataset.settings_text import settings_text
from copolicy.tasks.table.features import theta_of
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.world import TableWorld

HALF, EIGHTH = Physics(), Physics(angular_acceleration_limit=math.pi / 8)
HALF_WORDS, EIGHTH_WORDS = (f"angular acceleration up to {name} rad/s^2" for name in ("pi/2", "pi/8"))


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> Path:
    """Recordings and data sets under two physics: `half`, `eighth` and, converted together, `both`."""
    folder = tmp_path_factory.mktemp("mixtures")
    simulated(folder / "raw" / "half", 3, seed=1)
    simulate(folder / "raw" / "eighth", 2, seed=2, workers=1, settings=EIGHTH)
    for name in ("half", "eighth"):
        make_data_set(folder / "raw" / name, folder / name)
    make_data_set(folder / "raw", folder / "both")
    return folder


@pytest.fixture
def copied(folders, tmp_path):
    """A copy of a data set by its name."""
    return lambda name: Path(shutil.copytree(folders / name, tmp_path / name))


def without_later_columns(root: Path) -> Path:
    """As data sets of earlier versions are."""
    table = pq.ParquetFile(root / EPISODES).read()
    pq.write_table(table.drop_columns(list(LATER_COLUMNS)), root / EPISODES)
    return root


@pytest.fixture
def run(capsys, caplog):
    """Summary and warnings of a call that succeeds."""

    def run(*arguments: object) -> tuple[dict, list[str]]:
        caplog.clear()
        capsys.readouterr()
        assert main([*map(str, arguments), "--json"]) == 0
        return json.loads(capsys.readouterr().out), caplog.messages

    return run


def findings(root: Path, rule: str) -> list[tuple[str, str, object]]:
    return [(f.severity, f.episode, f.figure) for f in check_dataset(root).findings if f.rule == rule]


def physics_in(root: Path) -> list[dict]:
    return [json.loads(text) for text in load(root).meta.episodes["physics"]]


def test_the_physics_of_each_episode_is_in_the_data_set(folders):
    assert physics_in(folders / "both") == [asdict(EIGHTH)] * 2 + [asdict(HALF)] * 3
    assert load(folders / "both").meta.episodes["obstacle_size"] == [50] * 5


def test_a_conversion_reports_mixtures(folders, tmp_path, run):
    summary, errors = run("mcap", folders / "raw", "--out", tmp_path / "set", "--repo-id", "lab/table")
    assert summary["physics"] == {HALF_WORDS: 3, EIGHTH_WORDS: 2}
    assert summary["mixed"] == [f"physics: 3 episodes {HALF_WORDS}; 2 episodes {EIGHTH_WORDS}"]
    assert errors == [f"warning: this data set mixes {summary['mixed'][0]}"]
    summary, errors = run("mcap", folders / "raw/half", "--out", tmp_path / "one", "--repo-id", "lab/table")
    assert (summary["physics"], "mixed" in summary, errors) == ({HALF_WORDS: 3}, False, [])


def test_a_conversion_in_shards_reports_mixtures(folders, tmp_path, run):
    flags = ("--shard-episodes", 2, "--workers", 1)
    summary, _ = run("mcap", folders / "raw", "--out", tmp_path / "set", "--repo-id", "lab/table", *flags)
    assert summary["physics"] == {HALF_WORDS: 3, EIGHTH_WORDS: 2}
    assert any(line.startswith("warning: physics: episodes with different physics") for line in summary["findings"])
    assert physics_in(tmp_path / "set") == physics_in(folders / "both")


def test_append_and_merge_keep_the_physics_and_say_the_mixture(folders, copied, tmp_path, run):
    line = f"physics: 3 episodes {HALF_WORDS}; 2 episodes {EIGHTH_WORDS}"
    root = copied("half")
    summary, errors = run("mcap", folders / "raw/eighth", "--out", root, "--repo-id", "lab/table", "--append")
    assert (summary["physics"], summary["mixed"][0]) == ({HALF_WORDS: 3, EIGHTH_WORDS: 2}, line)
    assert errors == [f"warning: this data set mixes {line}"]
    summary, errors = run(
        "merge", folders / "half", folders / "eighth", "--out", tmp_path / "merged", "--repo-id", "lab/both"
    )
    assert (summary["physics"], summary["mixed"]) == ({HALF_WORDS: 3, EIGHTH_WORDS: 2}, [line])
    assert errors == [f"warning: this data set mixes {line}"]
    for path in (root, tmp_path / "merged"):
        assert physics_in(path) == [asdict(HALF)] * 3 + [asdict(EIGHTH)] * 2
        assert findings(path, "physics") == [("warning", "", 2)]


def test_a_data_set_of_an_earlier_version_can_be_added_to_and_merged(folders, copied, tmp_path, run):
    old = without_later_columns(copied("half"))
    summary, _ = run("merge", old, folders / "eighth", "--out", tmp_path / "merged", "--repo-id", "lab/both")
    assert summary["physics"] == {"unknown": 3, EIGHTH_WORDS: 2}
    before = pq.ParquetFile(old / EPISODES).read()
    summary, _ = run("mcap", folders / "raw/eighth", "--out", old, "--repo-id", "lab/table", "--append")
    assert summary["columns_added"] == list(LATER_COLUMNS)
    assert summary["physics"] == {"unknown": 3, EIGHTH_WORDS: 2}
    after = pq.ParquetFile(old / EPISODES).read()
    assert str(after.select(before.column_names).to_pylist()) == str(before.to_pylist())
    for root in (old, tmp_path / "merged"):
        rows = load(root).meta.episodes
        assert rows["physics"] == [""] * 3 + [settings_text(EIGHTH)] * 2
        assert rows["obstacle_size"] == [0] * 3 + [50] * 2
        assert findings(root, "physics") == [("info", "", 3)]
        assert {f.rule for f in check_dataset(root).findings if f.severity == "error"} <= {"license"}


def test_every_reader_takes_a_data_set_of_an_earlier_version(copied, tmp_path, run):
    root = without_later_columns(copied("half"))
    assert [f for f in check_dataset(root).findings if f.severity == "error"] == []
    assert ExportSource.open(root).facts()["physics"] == {"unknown": 3}
    for format, out in (("zarr", "a.zarr"), ("robomimic", "a.hdf5"), ("minari", "a-v0")):
        summary, _ = run("export", root, "--format", format, "--out", tmp_path / out)
        assert summary["physics"] == {"unknown": 3}
    assert cards(["dataset", str(root), "--repo-id", "lab/table", "--croissant"]) == 0
    assert "| physics | unknown (3 of 3 episodes) |" in (root / "README.md").read_text(encoding="utf-8")
    croissant = json.loads((root / "meta/croissant.json").read_text(encoding="utf-8"))
    fields = {field["name"] for field in croissant["recordSet"][1]["field"]}
    assert "episodes/license" in fields
    assert not fields & {f"episodes/{name}" for name in LATER_COLUMNS}
    assert cards(["report", str(root), "--out", str(tmp_path / "page.html")]) == 0


def test_a_mixture_in_recordings_is_a_finding(folders):
    assert findings(folders / "raw", "physics") == [("warning", "", 2)]
    assert findings(folders / "raw" / "eighth", "physics") == []
    message = next(f.message for f in check_dataset(folders / "raw").findings if f.rule == "physics")
    assert message.endswith(f": 3 {HALF_WORDS}; 2 {EIGHTH_WORDS}")


def test_a_physics_that_cannot_be_read_is_an_error(copied, tmp_path, capsys):
    root = copied("half")
    set_columns(root, physics=["pi/8", settings_text(HALF), None])
    assert findings(root, "physics") == [("error", "0", None), ("info", "", 1)]
    assert main(["export", str(root), "--format", "zarr", "--out", str(tmp_path / "a.zarr")]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"copolicy-convert: {root}: expected the settings of episode 0, found physics: expected ")
    assert error.count("\n") == 1


def turned(physics: Physics, state: np.ndarray, action: np.ndarray, steps: int) -> np.ndarray:
    """The state `(7,)` after an action is held for some steps, as the world has it."""
    world = TableWorld(MapConfig((600.0, 300.0, 0.0), (1150.0, 50.0)), physics)
    world.reset((state[0], state[1], float(theta_of(state))), state[4:].tolist())
    for _ in range(steps):
        world.step(action)
    (x, y, theta), velocity = world.pose, world.velocity
    return np.array([x, y, math.cos(theta), math.sin(theta), *velocity])


def test_exports_go_on_under_the_physics_of_each_episode(folders, tmp_path):
    source = ExportSource.open(folders / "both")
    recorded = {}
    for path in sorted((folders / "raw").rglob("*.mcap")):
        episode = read_episode(path)
        recorded[episode.meta.episode_uuid] = episode
    differ = 0
    for episode, physics in zip(source.episodes(), [EIGHTH] * 2 + [HALF] * 3, strict=True):
        assert episode.settings == physics == recorded[episode.meta["episode_uuid"]].physics
        steps = round(episode.meta["duration_s"] * 30) - 3 * (len(episode) - 1)
        last, action = episode.states[-1].astype(float), episode.actions[-1].astype(float)
        expected = turned(physics, last, action, steps)
        np.testing.assert_allclose(episode.final_state(), expected, rtol=1e-5, atol=1e-4)
        second = turned(HALF if physics == EIGHTH else EIGHTH, last, action, steps)
        differ += abs(expected[6] - second[6]) > 1e-3
    assert differ
    with contextlib.redirect_stdout(io.StringIO()):
        for format, out in (("zarr", "a.zarr"), ("robomimic", "a.hdf5"), ("minari", "a-v0")):
            assert main(["export", str(folders / "both"), "--format", format, "--out", str(tmp_path / out)]) == 0
        flags = ["--format", "zarr", "--alignment", "upstream", "--out", str(tmp_path / "b.zarr")]
        assert main(["export", str(folders / "both"), *flags]) == 0
    counts = {HALF_WORDS: 3, EIGHTH_WORDS: 2}
    attributes = json.loads((tmp_path / "a.zarr/.zattrs").read_text(encoding="utf-8"))
    assert attributes["physics"] == counts
    assert [json.loads(row["physics"]) for row in attributes["episodes"]] == [asdict(EIGHTH)] * 2 + [asdict(HALF)] * 3
    obs, ends = (ZarrArrays(tmp_path / "b.zarr", name).read(name) for name in ("data/obs", "meta/episode_ends"))
    start = 0
    for episode, end in zip(source.episodes(), ends, strict=True):
        state, action = episode.states[0].astype(float), episode.actions[0].astype(float)
        np.testing.assert_allclose(obs[start, :7], turned(episode.settings, state, action, 1), rtol=1e-6, atol=1e-5)
        start = end
    with h5py.File(tmp_path / "a.hdf5", "r") as file:
        assert json.loads(str(file["data"].attrs["copolicy"]))["physics"] == counts
        assert json.loads(str(file["data/demo_0"].attrs["physics"])) == asdict(EIGHTH)
        assert json.loads(str(file["data"].attrs["env_args"]))["env_kwargs"] == {"fps": 10}
        after = np.asarray(file["data/demo_0/next_obs/agent_pos"])[-1]
        np.testing.assert_array_equal(after, next(iter(source.episodes())).final_state())
    metadata = json.loads((tmp_path / "a-v0/data/metadata.json").read_text(encoding="utf-8"))
    assert metadata["copolicy"]["physics"] == counts


def test_robomimic_makes_the_environment_of_the_one_physics(folders, tmp_path):
    with contextlib.redirect_stdout(io.StringIO()):
        out = tmp_path / "a.hdf5"
        assert main(["export", str(folders / "eighth"), "--format", "robomimic", "--out", str(out)]) == 0
    with h5py.File(out, "r") as file:
        arguments = json.loads(str(file["data"].attrs["env_args"]))["env_kwargs"]
    assert arguments == {"fps": 10, "angular_acceleration_limit": math.pi / 8}


def test_the_card_states_the_physics(copied):
    root = copied("both")
    with contextlib.redirect_stdout(io.StringIO()):
        assert cards(["dataset", str(root), "--repo-id", "lab/table"]) == 0
    text = (root / "README.md").read_text(encoding="utf-8")
    assert f"| physics | {HALF_WORDS} (3 of 5 episodes); {EIGHTH_WORDS} (2 of 5 episodes) |" in text


def test_a_replay_of_another_physics_is_reported(folders, caplog):
    path = sorted((folders / "raw" / "eighth").glob("*.mcap"))[0]
    specs = (PlayerSpec.parse(f"replay:{path}"), PlayerSpec.parse("scripted"))
    players = make_players("P01", specs, ("", ""))
    warn_other_settings(players, EIGHTH)
    assert caplog.messages == []
    warn_other_settings(players, HALF)
    assert caplog.messages == [
        f"warning: replay:{path.stem} was recorded with {EIGHTH_WORDS}, this session has {HALF_WORDS}"
    ]


def record(path: Path, config: MapConfig, **columns) -> None:
    """A recording of ten steps."""
    world = TableWorld(config)
    path.parent.mkdir(parents=True, exist_ok=True)
    with EpisodeRecorder(path, config, EpisodeMeta(path.stem, **columns)) as recorder:
        for action in np.random.default_rng(len(path.stem)).uniform(-1, 1, (10, 4)):
            world.step(action)
            recorder.step(action, world.recorded, world.reward())
        recorder.finish(False, "operator_discard", discarded=False)


def test_obstacles_of_several_sizes_are_reported(tmp_path, run):
    config = MapConfig((240.0, 300.0, 3.14), (960.0, 300.0), ((600.0, 100.0),))
    for name, size in (("a", 50), ("bb", 30), ("ccc", 30)):
        custom = MapConfig(config.start, config.goal, config.obstacles, size)
        record(tmp_path / "raw" / f"{name}.mcap", custom, map_id=f"custom-{name}", map_set="custom")
    training = MAP_SETS["training"][0]
    wrong = MapConfig(training.start, training.goal, training.obstacles, 45)
    record(tmp_path / "raw" / "dddd.mcap", wrong, map_id="training-00", map_set="training")
    summary, errors = run("mcap", tmp_path / "raw", "--out", tmp_path / "set", "--repo-id", "lab/table")
    assert summary["mixed"] == ["obstacles of map set custom: 1 episode 50 px; 2 episodes 30 px"]
    assert errors == [f"warning: this data set mixes {summary['mixed'][0]}"]
    expected = [("error", {"set": "3", "raw": "dddd.mcap"}, 45), ("warning", {"set": "", "raw": ""}, 2)]
    for name in ("set", "raw"):
        found = findings(tmp_path / name, "obstacle_size")
        assert found == [(severity, episodes[name], figure) for severity, episodes, figure in expected]


def test_other_software_sources_and_rewards_are_reported(folders, copied, tmp_path, run):
    first, second = copied("half"), copied("eighth")
    set_columns(second, software_version=["0.0.1"] * 2, physics=[settings_text(HALF)] * 2, source=["upstream"] * 2)
    set_frames(second, "next.reward", lambda rewards: rewards + 1)
    record = second / "meta" / "copolicy.json"
    record.write_text(
        json.dumps({**json.loads(record.read_text(encoding="utf-8")), "version": "0.0.1"}), encoding="utf-8"
    )
    summary, errors = run("merge", first, second, "--out", tmp_path / "out", "--repo-id", "lab/both")
    version = json.loads((first / "meta" / "copolicy.json").read_text(encoding="utf-8"))["version"]
    assert summary["mixed"] == [
        "source: 3 episodes simulated; 2 episodes upstream",
        f"software_version: 3 episodes {version}; 2 episodes 0.0.1",
        f"converted by versions 0.0.1, {version}",
        "rewards: those of eighth differ by up to 1 from this version's definition",
    ]
    assert errors == [f"warning: this data set mixes {summary['mixed'][-1]}"]
    assert findings(tmp_path / "out", "mixture") == [("info", "", 2), ("info", "", 2)]
    assert (tmp_path / "out" / FRAMES).is_file()
    summary, _ = run("mcap", folders / "raw/half", "--out", second, "--repo-id", "lab/table", "--append")
    assert "rewards: those of eighth differ by up to 1 from this version's definition" in summary["mixed"]
    assert f"converted by versions 0.0.1, {version}" in summary["mixed"]
