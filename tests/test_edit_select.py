"""`copolicy-dataset select` copies episodes unchanged to a data set that LeRobot and the checks accept."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from checked_data import contents, make_data_set, make_recordings, set_columns
from edited_data import columns, digests, episode_statistics, info, load, split_files
from lerobot.datasets.compute_stats import aggregate_stats

from copolicy.convert.video.scene_video import SCENE
from copolicy.dataset.checks.checking import check_dataset
from copolicy.dataset.cli import main
from copolicy.dataset.edit.select import select
from copolicy.dataset.edit.selection import Selection
from copolicy.dataset.exceptions import FileFormatError, RunError
from copolicy.dataset.features import ACTION
from copolicy.dataset.lerobot_folder.exclusions import exclude
from copolicy.dataset.publication.minimal_card import is_minimal_card
from copolicy.dataset.versions.content import read_content

VIDEO = ("--no-drift", "--video", "--video-size", "160x80")


@pytest.fixture
def root(people_set, tmp_path) -> Path:
    return Path(shutil.copytree(people_set, tmp_path / "set"))


@pytest.fixture(scope="module")
def filmed(tmp_path_factory) -> Path:
    """Five episodes with videos in two files."""
    folder = tmp_path_factory.mktemp("filmed")
    root = make_data_set(make_recordings(folder / "a", 3, seed=1), folder / "set", *VIDEO)
    make_recordings(folder / "b", 2, seed=2)
    make_data_set(folder / "b", root, "--append")
    return root


def stored_statistics(root: Path) -> dict:
    return json.loads((root / "meta" / "stats.json").read_text(encoding="utf-8"))


def test_selected_episodes_stay_unchanged(root, tmp_path):
    split_files(root, [range(0, 3), range(3, 8)])
    new = tmp_path / "new"
    summary = select(root, new, Selection(episodes=("1", "4-5", columns(root)[7]["episode_uuid"])))
    before, after = columns(root), columns(new)
    assert [row["episode_uuid"] for row in after] == [before[number]["episode_uuid"] for number in (1, 4, 5, 7)]
    assert [row["episode_index"] for row in after] == [0, 1, 2, 3]
    lengths = [row["length"] for row in after]
    assert [row["dataset_to_index"] for row in after] == np.cumsum(lengths).tolist()
    kept = digests(root)
    assert {uuid: episode.digest for uuid, episode in digests(new).items()} == {
        row["episode_uuid"]: kept[row["episode_uuid"]].digest for row in after
    }
    assert (summary["episodes"], summary["left_out"]) == (4, 4)
    assert summary["content_hash"] == read_content(new).hash
    assert summary["made_from"] == read_content(root).hash


def test_the_checks_pass_and_lerobot_loads_all_episodes_and_single_ones(root, tmp_path):
    set_columns(root, consent_id=["C-1"] * 8)
    select(root, tmp_path / "new", Selection(pairs=("P02", "P04")))
    assert not check_dataset(tmp_path / "new").failed()
    whole, old = load(tmp_path / "new"), load(root)
    rows = columns(tmp_path / "new")
    assert (whole.num_episodes, whole.num_frames) == (4, sum(row["length"] for row in rows))
    first = columns(root)[2]["dataset_from_index"]
    for name in ("observation.state", ACTION, "timestamp", "frame_index", "next.reward"):
        assert whole[5][name].equal(old[first + 5][name])
    assert (int(whole[5]["index"]), int(whole[5]["episode_index"]), whole[5]["task"]) == (5, 0, old[0]["task"])
    for number, row in enumerate(rows):
        alone = load(tmp_path / "new", episodes=[number])
        assert alone.num_frames == row["length"]
        assert alone[0][ACTION].equal(whole[row["dataset_from_index"]][ACTION])


def test_statistics_equal_those_that_lerobot_aggregates(root, tmp_path):
    select(root, tmp_path / "new", Selection(episodes=("2", "5-6")))
    after = episode_statistics(tmp_path / "new")
    expected = aggregate_stats(after)
    stored = stored_statistics(tmp_path / "new")
    assert stored.keys() == expected.keys()
    for feature, kinds in expected.items():
        assert stored[feature].keys() == kinds.keys()
        for kind, values in kinds.items():
            np.testing.assert_array_equal(np.array(stored[feature][kind]), values, f"{feature} {kind}")
    before = [episode_statistics(root)[number] for number in (2, 5, 6)]
    for old, new in zip(before, after, strict=True):
        for feature in old:
            if feature not in ("index", "episode_index"):
                for kind, values in old[feature].items():
                    np.testing.assert_array_equal(new[feature][kind], values)
    # What converting these recordings alone would have given for the running numbers.
    rows = columns(tmp_path / "new")
    assert [entry["index"]["min"].item() for entry in after] == [row["dataset_from_index"] for row in rows]
    assert [entry["index"]["max"].item() for entry in after] == [row["dataset_to_index"] - 1 for row in rows]
    assert [entry["episode_index"]["q50"].item() for entry in after] == [0, 1, 2]


def test_the_result_equals_a_conversion_of_the_selected_recordings(tmp_path):
    """Compares content hash, info and statistics, which do not depend on the writer."""
    recordings = make_recordings(tmp_path / "recordings", 4, seed=5)
    root = make_data_set(recordings, tmp_path / "set")
    select(root, tmp_path / "new", Selection(episodes=("1", "3")))
    for number in (0, 2):
        (recordings / f"episode_{number:06d}.mcap").unlink()
    alone = make_data_set(recordings, tmp_path / "alone")
    assert read_content(tmp_path / "new").hash == read_content(alone).hash
    assert info(tmp_path / "new") == info(alone)
    assert stored_statistics(tmp_path / "new") == stored_statistics(alone)
    assert str(columns(tmp_path / "new")) == str(columns(alone))  # as text, because nan differs from itself


def images(root: Path, row: dict) -> np.ndarray:
    """All images of an episode as one window of frames, which LeRobot decodes in one pass."""
    window = load(root, delta_timestamps={SCENE: [frame / 10 for frame in range(row["length"])]})
    item = window[row["dataset_from_index"]]
    assert not item[f"{SCENE}_is_pad"].any()
    return item[SCENE].numpy()


def test_every_image_stays_with_its_frame(filmed, tmp_path):
    select(filmed, tmp_path / "new", Selection(episodes=("1-2", "4")))
    for before, after in zip([columns(filmed)[n] for n in (1, 2, 4)], columns(tmp_path / "new"), strict=True):
        for key in ("from", "to"):
            seconds = after[f"videos/{SCENE}/{key}_timestamp"] * 10
            assert seconds == pytest.approx(round(seconds))
        found = images(tmp_path / "new", after)
        assert len(found) == after["length"]
        np.testing.assert_array_equal(found, images(filmed, before))
    files = sorted(path.name for path in (tmp_path / "new" / "videos").rglob("*.mp4"))
    assert files == ["file-000.mp4", "file-001.mp4"]
    assert info(tmp_path / "new")["features"] == info(filmed)["features"]
    assert not check_dataset(tmp_path / "new").failed()
    alone = load(tmp_path / "new", episodes=[2])
    np.testing.assert_array_equal(
        alone[3][SCENE].numpy(), load(filmed)[columns(filmed)[4]["dataset_from_index"] + 3][SCENE].numpy()
    )


def test_a_file_whose_episodes_are_all_selected_is_copied(filmed, tmp_path):
    select(filmed, tmp_path / "new", Selection(episodes=("0", "3-4")))
    files = [tmp_path / "new", filmed]
    bytes_of = [(folder / "videos" / SCENE / "chunk-000" / "file-001.mp4").read_bytes() for folder in files]
    assert bytes_of[0] == bytes_of[1]


@pytest.mark.parametrize(
    ("selection", "expected"),
    [
        (Selection(pairs=("P01", "P03")), [0, 1, 4, 5]),
        (Selection(players=("P02-b",)), [2, 3]),
        (Selection(consents=("C-2",)), [0, 1, 4, 5]),
        (Selection(consents=("C-2",), pairs=("P03", "P04")), [4, 5]),
        (Selection(sources=("human",), episodes=("0-2",)), [0, 1, 2]),
        (Selection(where='pair_id in ("P01", "P04") and consent_id != ""'), [0, 1, 6]),
        (Selection(episodes=("6-7",), where="episode_index > 6"), [7]),
    ],
)
def test_flags_are_combined_and_values_are_alternatives(people_set, selection, expected):
    from copolicy.dataset.edit.subset.stored_set import StoredSet

    stored = StoredSet.read(people_set)
    assert selection.numbers(stored.rows, stored.column_types) == expected


def test_results_maps_and_exclusions(root, tmp_path):
    rows = columns(root)
    exclude(root, ["0", "3"], "a reason")
    select(root, tmp_path / "kept", Selection(drop_excluded=True))
    assert [row["episode_uuid"] for row in columns(tmp_path / "kept")] == [
        row["episode_uuid"] for row in rows if row["episode_index"] not in (0, 3)
    ]
    successes = [row["episode_uuid"] for row in rows if row["success"]]
    select(root, tmp_path / "successes", Selection(results=("success",)))
    assert [row["episode_uuid"] for row in columns(tmp_path / "successes")] == successes
    select(root, tmp_path / "goal", Selection(results=("goal",), map_ids=(rows[1]["map_id"],)))
    assert {row["map_id"] for row in columns(tmp_path / "goal")} == {rows[1]["map_id"]}


def test_record_extra_keys_splits_and_licences_are_copied(root, tmp_path):
    uuids = [row["episode_uuid"] for row in columns(root)]
    record = json.loads((root / "meta/copolicy.json").read_text(encoding="utf-8"))
    record["notes"] = {uuids[0]: ["mended"], uuids[5]: ["doubtful"]}
    (root / "meta/copolicy.json").write_text(json.dumps(record), encoding="utf-8")
    fields = {**info(root), "splits": {"train": "0:5", "valid": "5:8"}, "lab": {"room": 3}}
    (root / "meta/info.json").write_text(json.dumps(fields), encoding="utf-8")
    (root / "LICENSE").write_text("text of a licence", encoding="utf-8")
    (root / "README.md").write_text("a card", encoding="utf-8")
    (root / "raw").mkdir()
    summary = select(root, tmp_path / "new", Selection(episodes=("0-1", "4", "6")))
    assert info(tmp_path / "new")["splits"] == {"train": "0:3", "valid": "3:4"}
    assert info(tmp_path / "new")["lab"] == {"room": 3}
    assert (tmp_path / "new" / "LICENSE").read_text(encoding="utf-8") == "text of a licence"
    after = json.loads((tmp_path / "new/meta/copolicy.json").read_text(encoding="utf-8"))
    assert after["notes"] == {uuids[0]: ["mended"]}
    (note,) = after["selections"]
    assert note["asked"] == {"episodes": ["0-1", "4", "6"]}
    assert note["from"] == {"name": "set", "content_hash": read_content(root).hash, "episodes": 8}
    assert summary["not_carried"] == ["README.md", "raw/"]
    assert is_minimal_card(tmp_path / "new" / "README.md")


@pytest.mark.parametrize(
    ("flags", "status", "line"),
    [
        (["--where", "duration_s < 0"], 1, "expected at least one selected episode, found none"),
        (["--pair-ids", "P99"], 1, "--pair-ids: expected a value of the data set, found 'P99', which no episode has"),
        (["--pair-ids", "P01", "P99"], 1, "--pair-ids: expected a value of the data set, found 'P99'"),
        (["--episode-ids", "99"], 2, "--episode-ids: expected numbers from 0 to 7"),
        (["--results", "won"], 2, "--results: expected one of success, failure, goal"),
        (["--sources", "robot"], 2, "--sources: expected one of human, simulated, upstream, found 'robot'"),
        ([], 2, "select: expected at least one of --episode-ids"),
    ],
)
def test_nothing_is_written_for_a_wrong_call(root, tmp_path, capsys, flags, status, line):
    before = contents(root)
    assert main(["select", str(root), "--out", str(tmp_path / "new"), *flags]) == status
    error = capsys.readouterr().err
    assert line in error
    assert error.count("\n") == 1
    assert contents(root) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["set"]


def test_an_output_that_exists_and_a_set_without_columns(root, tmp_path, capsys):
    (tmp_path / "new").mkdir()
    assert main(["select", str(root), "--out", str(tmp_path / "new"), "--episode-ids", "0"]) == 2
    assert "nothing was overwritten" in capsys.readouterr().err
    assert main(["select", str(tmp_path / "none"), "--out", str(tmp_path / "b"), "--episode-ids", "0"]) == 2
    assert "expected a LeRobot v3 data set with meta/info.json, found no such file or folder" in capsys.readouterr().err


def test_a_damaged_copy_leaves_nothing(root, tmp_path, monkeypatch):
    from copolicy.dataset.edit.subset import writing as subset

    original = subset._shift_statistics
    monkeypatch.setattr(subset, "_shift_statistics", lambda rows, firsts: original(rows, firsts).slice(0, 1))
    with pytest.raises(FileFormatError):
        select(root, tmp_path / "new", Selection(episodes=("0-2",)))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["set"]
    monkeypatch.undo()
    changed = columns(root)[1]["episode_uuid"]
    real = subset._frames

    def shifted(source, numbers):
        for number, table in zip(numbers, real(source, numbers), strict=True):
            if source.rows[number]["episode_uuid"] == changed:
                table = table.take([*range(1, len(table)), 0])
            yield table

    monkeypatch.setattr(subset, "_frames", shifted)
    with pytest.raises(RunError, match="expected episode 1 unchanged in the new data set"):
        select(root, tmp_path / "new", Selection(episodes=("0-2",)))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["set"]
