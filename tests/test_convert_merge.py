"""`copolicy-convert merge`: no content of an episode is lost, and no pseudonyms are mixed up."""

import json
import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from checked_data import EPISODES, contents, make_data_set, make_recordings, set_columns
from loaded_sets import assert_same_frames, assert_same_statistics, load

from copolicy.convert.cli import main
from copolicy.convert.merge import merge_datasets
from copolicy.dataset.checks.checking import check_dataset
from copolicy.dataset.lerobot_folder.exclusions import exclude, excluded_episodes
from copolicy.dataset.publication.minimal_card import is_minimal_card
from copolicy.dataset.versions.content import read_content

PEOPLE = {
    "session_id": ["s1", "s1", "s2"],
    "pair_id": ["P01", "P01", "P02"],
    "player_0_id": ["P01-a", "P01-b", "P02-a"],
    "player_1_id": ["P01-b", "P01-a", "P02-b"],
    "consent_id": ["C1", "C1", ""],
    "source": ["human"] * 3,
}


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> Path:
    """Two data sets, `a` with the drift measured and `b` without, and `both`, converted together without."""
    folder = tmp_path_factory.mktemp("merge")
    for name, seed in (("a", 1), ("b", 2)):
        make_recordings(folder / "raw" / name, 3, seed=seed)
    make_data_set(folder / "raw" / "a", folder / "a", "--no-drift")
    make_data_set(folder / "raw" / "b", folder / "b", "--no-drift")
    make_data_set(folder / "raw", folder / "both", "--no-drift")
    return folder


@pytest.fixture
def roots(folders, tmp_path) -> tuple[Path, Path]:
    return Path(shutil.copytree(folders / "a", tmp_path / "a")), Path(shutil.copytree(folders / "b", tmp_path / "b"))


def merge(out: Path, *arguments: object) -> int:
    return main(["merge", *map(str, arguments), "--out", str(out), "--repo-id", "lab/both", "--json"])


def episodes(root: Path) -> pa.Table:
    return pq.ParquetFile(root / EPISODES).read()


def test_the_result_is_that_of_one_conversion(folders, tmp_path, capsys):
    assert merge(tmp_path / "out", folders / "a", folders / "b") == 0
    captured = capsys.readouterr()
    summary = json.loads(captured.out)
    assert captured.err == ""
    assert summary["content_hash"] == read_content(folders / "both").hash == read_content(tmp_path / "out").hash
    assert (summary["episodes"], summary["excluded"]) == (6, 0)
    merged, together = load(tmp_path / "out"), load(folders / "both")
    assert_same_frames(merged, together, every=97)
    assert_same_statistics(merged, together)
    merged_rows, expected_rows = episodes(tmp_path / "out"), episodes(folders / "both")
    assert {field.name: field.type for field in merged_rows.schema} == {
        field.name: field.type for field in expected_rows.schema
    }
    assert merged_rows.column("replay_drift_px").to_pylist() == [None] * 6
    data = "data/chunk-000/file-000.parquet"
    assert pq.read_schema(tmp_path / "out" / data).equals(pq.read_schema(folders / "both" / data), check_metadata=False)
    assert pq.read_metadata(tmp_path / "out" / data).num_row_groups == 6
    assert [finding for finding in check_dataset(tmp_path / "out").findings if finding.severity == "error"] == []


def test_exclusions_and_records_are_kept_and_files_about_one_part_are_not_copied(roots, tmp_path, capsys):
    first, second = roots
    exclude(first, ["1"], "stick unplugged")
    exclude(second, ["2"], "withdrawn")
    (first / "meta" / "copolicy_stats.json").write_text("{}", encoding="utf-8")
    (second / "README.md").write_text("card", encoding="utf-8")
    hashes = [read_content(root).hash for root in roots]
    assert merge(tmp_path / "out", *roots) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["excluded"] == 2
    assert summary["left_behind"] == {str(first): ["meta/copolicy_stats.json"], str(second): ["README.md"]}
    out = tmp_path / "out"
    assert [(entry.episode, entry.reason) for entry in excluded_episodes(out)] == [
        (1, "stick unplugged"),
        (5, "withdrawn"),
    ]
    record = json.loads((out / "meta" / "copolicy.json").read_text(encoding="utf-8"))
    assert [source["content_hash"] for source in record["merged"]] == hashes
    assert [source["record"]["files"] for source in record["merged"]] == [3, 3]
    assert record["hold"] == "mean"
    assert str(tmp_path) not in json.dumps(record)
    assert not (out / "meta" / "copolicy_stats.json").exists()
    assert is_minimal_card(out / "README.md")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b", "out"]


def test_a_merge_can_be_merged_again(folders, roots, tmp_path):
    assert merge(tmp_path / "once", *roots) == 0
    make_recordings(tmp_path / "raw", 2, seed=3)
    make_data_set(tmp_path / "raw", tmp_path / "c", "--no-drift")
    assert merge(tmp_path / "twice", tmp_path / "once", tmp_path / "c") == 0
    assert load(tmp_path / "twice").num_episodes == 8
    uuids = episodes(tmp_path / "twice").column("episode_uuid").to_pylist()
    assert uuids[:6] == episodes(folders / "both").column("episode_uuid").to_pylist()


def test_a_column_of_one_lab_is_kept_and_null_for_the_other(roots, tmp_path):
    first, second = roots
    table = episodes(first)
    pq.write_table(table.append_column("site", pa.array(["north", "south", "north"])), first / EPISODES)
    assert merge(tmp_path / "out", second, first) == 0
    assert episodes(tmp_path / "out").column("site").to_pylist() == [None] * 3 + ["north", "south", "north"]


def test_a_name_in_two_labs_needs_a_flag(roots, tmp_path, capsys):
    first, second = roots
    set_columns(first, **PEOPLE)
    set_columns(second, **{**PEOPLE, "source": ["human", "human", "simulated"]})
    out = tmp_path / "out"
    assert merge(out, first, second) == 2
    assert capsys.readouterr().err == (
        "copolicy-convert: consent 'C1': expected a name in one of the data sets only, or --prefix-people LAB LAB "
        f"(different people) or --same-people (the same), found 'it in {first} and {second}'\n"
    )
    set_columns(second, consent_id=[""] * 3)
    assert merge(out, first, second) == 2
    assert capsys.readouterr().err.startswith("copolicy-convert: pair 'P01': expected a name in one of")
    assert not out.exists()
    assert merge(tmp_path / "same", first, second, "--same-people") == 0
    assert episodes(tmp_path / "same").column("pair_id").to_pylist() == PEOPLE["pair_id"] * 2
    assert merge(out, first, second, "--prefix-people", "kth", "delft") == 0
    rows = episodes(out).to_pydict()
    assert rows["pair_id"] == ["kth-P01", "kth-P01", "kth-P02", "delft-P01", "delft-P01", "P02"]  # the last: simulated
    assert rows["player_0_id"][:4] == ["kth-P01-a", "kth-P01-b", "kth-P02-a", "delft-P01-a"]
    assert rows["consent_id"] == ["kth-C1", "kth-C1", "", "", "", ""]
    assert rows["session_id"][3:] == ["delft-s1", "delft-s1", "s2"]
    record = json.loads((out / "meta" / "copolicy.json").read_text(encoding="utf-8"))
    assert [source["prefix"] for source in record["merged"]] == ["kth", "delft"]


def test_players_are_compared_across_the_seats(roots, tmp_path, capsys):
    first, second = roots
    blank = {"pair_id": [""] * 3, "consent_id": [""] * 3, "source": ["human"] * 3}
    set_columns(first, **blank, player_0_id=["anna", "", ""], player_1_id=[""] * 3)
    set_columns(second, **blank, player_0_id=[""] * 3, player_1_id=["", "anna", ""])
    assert merge(tmp_path / "out", first, second) == 2
    assert capsys.readouterr().err.startswith("copolicy-convert: player 'anna': expected a name in one of")


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--prefix-people", "kth"], "--prefix-people: expected 2 different names, one for each data set, found"),
        (["--prefix-people", "a", "a"], "--prefix-people: expected 2 different names, one for each data set, found"),
        (["--prefix-people", "a", "b/c"], "--prefix-people: expected names of letters, digits and underscores"),
        (
            ["--repo-id", "both"],
            "--repo-id: expected USER/NAME that the Hub accepts (one slash between user and name), found 'both'",
        ),
    ],
)
def test_an_invalid_call_gives_one_line(folders, tmp_path, capsys, flags, message):
    arguments = [
        "merge",
        str(folders / "a"),
        str(folders / "b"),
        "--out",
        str(tmp_path / "x"),
        "--repo-id",
        "l/b",
        *flags,
    ]
    assert main(arguments) == 2
    assert capsys.readouterr().err.startswith(f"copolicy-convert: {message}")


def change_info(root: Path, change) -> None:
    path = root / "meta" / "info.json"
    info = json.loads(path.read_text(encoding="utf-8"))
    change(info)
    path.write_text(json.dumps(info), encoding="utf-8")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda info: info.update(fps=15), "expected fps 10, as in {first}, found 15"),
        (
            lambda info: info.update(codebase_version="v3.1"),
            "expected codebase_version 'v3.0', as in {first}, found 'v3.1'",
        ),
        (
            lambda info: info["features"]["action"].update(hold="first"),
            "expected the feature action of {first}, found hold 'first' instead of 'mean'",
        ),
    ],
)
def test_what_does_not_fit_is_refused(roots, tmp_path, capsys, change, message):
    first, second = roots
    change_info(second, change)
    assert merge(tmp_path / "out", first, second) == 2
    expected = message.format(first=first)
    assert capsys.readouterr().err == f"copolicy-convert: {second / 'meta' / 'info.json'}: {expected}\n"
    assert not (tmp_path / "out").exists()


def test_an_episode_in_both_is_refused(roots, tmp_path, capsys):
    first, second = roots
    shared = episodes(first).column("episode_uuid").to_pylist()[1]
    set_columns(second, episode_uuid=lambda uuids: [uuids[0], shared, uuids[2]])
    assert merge(tmp_path / "out", first, second) == 2
    assert capsys.readouterr().err == (
        f"copolicy-convert: {second}: expected no episode of {first}, found episode_uuid {shared} in both\n"
    )


def test_what_comes_out_changed_is_not_written(roots, tmp_path, capsys, monkeypatch):
    before = contents(tmp_path)
    changed = {"late_ticks": lambda values: [7] * len(values)}
    monkeypatch.setattr(merge_datasets, "_restore_episodes", lambda root, expected: set_columns(root, **changed))
    assert merge(tmp_path / "out", *roots) == 1
    error = capsys.readouterr().err
    assert "expected late_ticks unchanged by the merge, found otherwise; nothing was written" in error
    assert contents(tmp_path) == before


def test_an_existing_output_is_not_changed(folders, tmp_path, capsys):
    (tmp_path / "out").write_text("mine", encoding="utf-8")
    assert merge(tmp_path / "out", folders / "a", folders / "b") == 2
    assert "nothing was overwritten" in capsys.readouterr().err
    assert (tmp_path / "out").read_text(encoding="utf-8") == "mine"
