"""`copolicy-dataset amend`: declared columns are corrected in place, lost ones restored from originals."""

import json
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from checked_data import EPISODES, contents, set_columns
from edited_data import columns, digests, load, make_people
from lerobot.datasets.dataset_tools import delete_episodes, split_dataset

from copolicy.dataset.checks.checking import check_dataset
from copolicy.dataset.cli import main
from copolicy.dataset.edit.amend import AMENDABLE, amend, parse_settings
from copolicy.dataset.edit.restore import restore
from copolicy.dataset.edit.selection import Selection
from copolicy.dataset.episode import EPISODE_COLUMNS
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, RunError, UnknownNameError
from copolicy.dataset.versions.content import read_content
from copolicy.dataset.versions.release import release


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return make_people(tmp_path_factory.mktemp("amend"), episodes=6)


@pytest.fixture
def root(made, tmp_path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "set"))


def test_only_selected_columns_and_episodes_change(root):
    before, files = columns(root), contents(root)
    schema = pq.read_schema(root / EPISODES)
    summary = amend(root, {"consent_id": "C-12"}, Selection(episodes=("3-5",), where='pair_id == "P02"'))
    assert summary["amended"] == 1
    after = columns(root)
    assert [row["consent_id"] for row in after] == ["C-1,C-2", "C-1,C-2", "C-3", "C-12", "C-2", "C-2"]
    for old, new in zip(before, after, strict=True):
        assert str({**old, "consent_id": ""}) == str({**new, "consent_id": ""})
    assert pq.read_schema(root / EPISODES).equals(schema)
    now = contents(root)
    changed = {name for name in files.keys() | now.keys() if files.get(name) != now.get(name)}
    assert changed == {EPISODES.as_posix(), "meta/copolicy.json"}


def test_the_record_omits_personal_values(root):
    amend(root, parse_settings(["license=cc0-1.0", "consent_id=C-77", "pair_id=P09"]))
    record = json.loads((root / "meta/copolicy.json").read_text(encoding="utf-8"))
    (note,) = record["amended"]
    assert note["episodes"] == 6
    assert note["columns"] == {
        "license": {"episodes": 6, "from": ["cc-by-4.0"], "to": "cc0-1.0"},
        "consent_id": {"episodes": 6},
        "pair_id": {"episodes": 6},
    }
    amend(root, {"license": "mit"}, Selection(episodes=("0",)))
    record = json.loads((root / "meta/copolicy.json").read_text(encoding="utf-8"))
    assert [entry["episodes"] for entry in record["amended"]] == [6, 1]
    text = (root / "meta/copolicy.json").read_text(encoding="utf-8")
    assert "C-77" not in text
    assert "P0" not in text


def test_it_is_a_patch_release_in_the_change_log(root):
    release(root, "minor", "The first.")
    amend(root, {"license": "cc0-1.0"})
    record = release(root, "patch", "The licence was forgotten.")
    assert record.version == "0.1.1"
    (change,) = record.changes
    assert change.startswith("6 episodes with other values of license")
    assert change in (root / "CHANGELOG.md").read_text(encoding="utf-8")


def test_a_column_of_nulls_gets_its_type(root):
    import pyarrow as pa

    table = pq.ParquetFile(root / EPISODES).read()
    place = table.column_names.index("license")
    pq.write_table(table.set_column(place, "license", pa.nulls(6)), root / EPISODES)
    amend(root, {"license": "mit"}, Selection(episodes=("1",)))
    assert [row["license"] for row in columns(root)] == ["", "mit", "", "", "", ""]
    assert read_content(root).episodes


@pytest.mark.parametrize(
    ("texts", "error", "line"),
    [
        (["success=true"], InvalidValueError, "--set: expected a declared column .*found 'success: it is"),
        (["duration_s=3"], InvalidValueError, "it is measured"),
        (["discarded=true"], InvalidValueError, "copolicy-dataset exclude sets it"),
        (["episode_uuid=x"], InvalidValueError, "it is measured or derived from the data"),
        (["licence=mit"], UnknownNameError, "unknown episode column 'licence'; available: consent_id"),
        (["license"], InvalidValueError, "NAME=VALUE"),
        (["license=mit", "license=x"], InvalidValueError, "each name once"),
        (["license=CC BY 4.0"], InvalidValueError, "--set license: expected cc-by-4.0, as the Hub spells it"),
        (["pair_id=Anna Smith"], InvalidValueError, "--set pair_id: expected up to 64 letters.*not a person's name"),
        (["consent_id=C-1,,C-2"], InvalidValueError, "--set consent_id"),
        (["source=robot"], InvalidValueError, "one of human, simulated, upstream"),
        (["source="], InvalidValueError, "one of human, simulated, upstream"),
    ],
)
def test_values_are_checked(texts, error, line):
    with pytest.raises(error, match=line):
        parse_settings(texts)


def test_every_amendable_column_is_an_episode_column():
    assert set(AMENDABLE) <= set(EPISODE_COLUMNS)
    assert parse_settings(["consent_id=C-1,C-2", "license=", "source=human"]) == {
        "consent_id": "C-1,C-2",
        "license": "",
        "source": "human",
    }


@pytest.mark.parametrize(
    ("flags", "status", "line"),
    [
        (["--set", "license=CC"], 2, "--set license"),
        (["--set", "source=human"], 1, "expected an episode with another value, found none; nothing was changed"),
        (["--set", "license=mit", "--where", "duration_s < 0"], 1, "expected at least one selected episode"),
        (["--set", "license=mit", "--pair-ids", "P77"], 1, "--pair-ids: expected a value of the data set"),
        (["--restore-from", "nowhere"], 1, "found an episode_uuid in each"),
        (["--restore-from", "nowhere", "--episode-ids", "1"], 2, "--restore-from: expected no other flag with it"),
    ],
)
def test_a_wrong_call_changes_nothing(root, capsys, flags, status, line):
    before = contents(root)
    assert main(["amend", str(root), *flags]) == status
    error = capsys.readouterr().err
    assert line in error
    assert error.count("\n") == 1
    assert contents(root) == before


@pytest.fixture(scope="module")
def stripped(made, tmp_path_factory) -> Path:
    """The data set after LeRobot's own delete: without episodes 1 and 4, and without our columns."""
    folder = tmp_path_factory.mktemp("stripped")
    delete_episodes(load(made), [1, 4], output_dir=folder / "set", repo_id="lab/left")
    return folder / "set"


@pytest.fixture
def left(stripped, tmp_path) -> Path:
    return Path(shutil.copytree(stripped, tmp_path / "left"))


def test_a_stripped_set_is_refused_with_a_hint(left, capsys):
    assert main(["check", str(left), "--no-save"]) == 1
    out = capsys.readouterr().out
    assert f"copolicy-dataset amend {left} --restore-from ORIGINAL" in out
    assert "copolicy-dataset select" in out
    assert main(["exclude", str(left), "--list"]) == 2
    assert "--restore-from ORIGINAL" in capsys.readouterr().err
    assert main(["select", str(left), "--out", str(left.parent / "new"), "--episode-ids", "0"]) == 2
    assert "--restore-from ORIGINAL" in capsys.readouterr().err


def test_columns_are_restored_from_an_earlier_version(left, made):
    before = digests(made)
    uuids = [columns(made)[number]["episode_uuid"] for number in (0, 2, 3, 5)]
    assert restore(left, made)["restored"] == 4
    assert [row["episode_uuid"] for row in columns(left)] == uuids
    assert {uuid: entry.digest for uuid, entry in digests(left).items()} == {
        uuid: before[uuid].digest for uuid in uuids
    }
    assert not [finding for finding in check_dataset(left).findings if finding.severity == "error"]
    record = json.loads((left / "meta/copolicy.json").read_text(encoding="utf-8"))
    assert record["converter"] == "copolicy-convert mcap"
    assert record["restored"][0]["episodes"] == 4
    assert load(left).num_episodes == 4


def test_columns_are_restored_from_recordings(left, made):
    summary = restore(left, made.parent / "recordings")
    assert (summary["restored"], summary["not_measured"]) == (4, "replay_drift_px, which conversion measures")
    assert summary["next"].startswith(f"copolicy-dataset amend {left} --set license=ID, which no original states")
    after = columns(left)
    assert all(row["replay_drift_px"] != row["replay_drift_px"] for row in after)
    for row, original in zip(after, [columns(made)[number] for number in (0, 2, 3, 5)], strict=True):
        for name in ("episode_uuid", "map_id", "source_sha256", "success", "route_class", "seed", "duration_s"):
            assert row[name] == original[name]
    amend(left, {"license": "mit"})
    assert not check_dataset(left).failed()


def test_lerobots_split_is_restored_too(made, tmp_path):
    parts = split_dataset(load(made), {"a": [0, 1, 2], "b": [3, 4, 5]}, output_dir=tmp_path / "parts")
    for name, part in parts.items():
        restore(part.root, made)
        wanted = [columns(made)[number]["episode_uuid"] for number in ((0, 1, 2) if name == "a" else (3, 4, 5))]
        assert [row["episode_uuid"] for row in columns(part.root)] == wanted


def test_only_rows_without_a_uuid_are_restored(root, made):
    """As after a merge of a set with its columns and one without."""
    values = columns(root)
    set_columns(root, episode_uuid=[None if n in (1, 4) else row["episode_uuid"] for n, row in enumerate(values)])
    set_columns(root, license=["mit"] * 6, pair_id=["P08"] * 6)
    assert restore(root, made)["restored"] == 2
    after = columns(root)
    assert [row["episode_uuid"] for row in after] == [row["episode_uuid"] for row in values]
    assert [row["license"] for row in after] == ["mit", "cc-by-4.0", "mit", "mit", "cc-by-4.0", "mit"]


def test_every_episode_needs_one_original(left, made, tmp_path, capsys):
    before = contents(left)
    recordings = tmp_path / "recordings"
    shutil.copytree(made.parent / "recordings", recordings)
    (recordings / "episode_000002.mcap").unlink()
    (recordings / "episode_000005.mcap").write_bytes(b"broken")
    with pytest.raises(RunError, match=r"found none for episode 1, 3 \(1 recordings cannot be read\); nothing was"):
        restore(left, recordings)
    twin = Path(shutil.copytree(made, tmp_path / "twin"))
    frames = twin / "data/chunk-000/file-000.parquet"
    table = pq.ParquetFile(frames).read()
    rows = columns(twin)
    import pyarrow as pa

    place = {name: table.column_names.index(name) for name in ("episode_index", "index")}
    copy = table.slice(rows[0]["dataset_from_index"], rows[0]["length"])
    copy = copy.set_column(place["episode_index"], "episode_index", pa.array([6] * len(copy)))
    copy = copy.set_column(place["index"], "index", pa.array(range(len(table), len(table) + len(copy))))
    pq.write_table(pa.concat_tables([table, copy]), frames)
    episodes = pq.ParquetFile(twin / EPISODES).read()
    pq.write_table(pa.concat_tables([episodes, episodes.slice(0, 1)]), twin / EPISODES)
    set_columns(
        twin, episode_index=list(range(7)), episode_uuid=lambda uuids: [*uuids[:6], "another"],
        dataset_from_index=lambda values: [*values[:6], len(table)],
        dataset_to_index=lambda values: [*values[:6], len(table) + len(copy)],
    )  # fmt: skip
    with pytest.raises(RunError, match="found several for episode 0; nothing was changed"):
        restore(left, twin)
    with pytest.raises(FileFormatError, match="neither"):
        restore(left, tmp_path / "nothing")
    assert main(["amend", str(left), "--restore-from", str(recordings)]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    assert contents(left) == before
