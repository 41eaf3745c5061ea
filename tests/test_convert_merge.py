"""`copolicy-convert merge`: nothing of an episode is lost, and nobody becomes somebody else."""

import json
import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from checked_data import EPISODES, contents, make_data_set, make_recordings, set_columns
from loaded_sets import assert_same_frames, assert_same_statistics, load

from copolicy.convert.cli import main
from copolicy.convert.merge import merging
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
def made(tmp_path_factory) -> Path:
    """Two data sets, `a` with the drift measured and `b` without, and `both`, converted together without."""
    folder = tmp_path_factory.mktemp("merge")
    for name, seed in (("a", 1), ("b", 2)):
        make_recordings(folder / "raw" / name, 3, seed=seed)
    make_data_set(folder / "raw" / "a", folder / "a", "--no-drift")
    make_data_set(folder / "raw" / "b", folder / "b", "--no-drift")
    make_data_set(folder / "raw", folder / "both", "--no-drift")
    return folder


@pytest.fixture
def roots(made, tmp_path) -> tuple[Path, Path]:
    return Path(shutil.copytree(made / "a", tmp_path / "a")), Path(shutil.copytree(made / "b", tmp_path / "b"))


def merge(out: Path, *arguments: object) -> int:
    return main(["merge", *map(str, arguments), "--out", str(out), "--repo-id", "lab/both", "--json"])


def episodes(root: Path) -> pa.Table:
    return pq.ParquetFile(root / EPISODES).read()


def test_the_result_is_that_of_one_conversion(made, tmp_path, capsys):
    assert merge(tmp_path / "out", made / "a", made / "b") == 0
    captured = capsys.readouterr()
    summary = json.loads(captured.out)
    assert captured.err == ""
    assert summary["content_hash"] == read_content(made / "both").hash == read_content(tmp_path / "out").hash
    assert (summary["episodes"], summary["excluded"]) == (6, 0)
    merged, whole = load(tmp_path / "out"), load(made / "both")
    assert_same_frames(merged, whole, every=97)
    assert_same_statistics(merged, whole)
    ours, theirs = episodes(tmp_path / "out"), episodes(made / "both")
    assert {field.name: field.type for field in ours.schema} == {field.name: field.type for field in theirs.schema}
    assert ours.column("replay_drift_px").to_pylist() == [None] * 6
    data = "data/chunk-000/file-000.parquet"
    assert pq.read_schema(tmp_path / "out" / data).equals(pq.read_schema(made / "both" / data), check_metadata=False)
    assert pq.read_metadata(tmp_path / "out" / data).num_row_groups == 6
    assert [found for found in check_dataset(tmp_path / "out").findings if found.severity == "error"] == []


def test_exclusions_and_records_are_kept_and_what_is_about_one_part_stays_behind(roots, tmp_path, capsys):
    one, other = roots
    exclude(one, ["1"], "stick unplugged")
    exclude(other, ["2"], "withdrawn")
    (one / "meta" / "copolicy_stats.json").write_text("{}", encoding="utf-8")
    (other / "README.md").write_text("card", encoding="utf-8")
    hashes = [read_content(root).hash for root in roots]
    assert merge(tmp_path / "out", *roots) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["excluded"] == 2
    assert summary["left_behind"] == {str(one): ["meta/copolicy_stats.json"], str(other): ["README.md"]}
    out = tmp_path / "out"
    assert [(entry.episode, entry.reason) for entry in excluded_episodes(out)] == [
        (1, "stick unplugged"),
        (5, "withdrawn"),
    ]
    record = json.loads((out / "meta" / "copolicy.json").read_text(encoding="utf-8"))
    assert [part["content_hash"] for part in record["merged"]] == hashes
    assert [part["record"]["files"] for part in record["merged"]] == [3, 3]
    assert record["hold"] == "mean"
    assert str(tmp_path) not in json.dumps(record)
    assert not (out / "meta" / "copolicy_stats.json").exists()
    assert is_minimal_card(out / "README.md")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b", "out"]


def test_a_merge_can_be_merged_again(made, roots, tmp_path):
    assert merge(tmp_path / "once", *roots) == 0
    make_recordings(tmp_path / "raw", 2, seed=3)
    make_data_set(tmp_path / "raw", tmp_path / "c", "--no-drift")
    assert merge(tmp_path / "twice", tmp_path / "once", tmp_path / "c") == 0
    assert load(tmp_path / "twice").num_episodes == 8
    uuids = episodes(tmp_path / "twice").column("episode_uuid").to_pylist()
    assert uuids[:6] == episodes(made / "both").column("episode_uuid").to_pylist()


def test_a_column_of_one_lab_alone_is_kept_and_null_for_the_other(roots, tmp_path):
    one, other = roots
    table = episodes(one)
    pq.write_table(table.append_column("site", pa.array(["north", "south", "north"])), one / EPISODES)
    assert merge(tmp_path / "out", other, one) == 0
    assert episodes(tmp_path / "out").column("site").to_pylist() == [None] * 3 + ["north", "south", "north"]


def test_one_name_in_two_labs_is_refused_until_somebody_says_who_it_is(roots, tmp_path, capsys):
    one, other = roots
    set_columns(one, **PEOPLE)
    set_columns(other, **{**PEOPLE, "source": ["human", "human", "simulated"]})
    out = tmp_path / "out"
    assert merge(out, one, other) == 2
    assert capsys.readouterr().err == (
        "copolicy-convert: consent 'C1': expected a name in one of the data sets only, or --prefix-people LAB LAB "
        f"(other people) or --same-people (the same), found 'it in {one} and {other}'\n"
    )
    set_columns(other, consent_id=[""] * 3)
    assert merge(out, one, other) == 2
    assert capsys.readouterr().err.startswith("copolicy-convert: pair 'P01': expected a name in one of")
    assert not out.exists()
    assert merge(tmp_path / "same", one, other, "--same-people") == 0
    assert episodes(tmp_path / "same").column("pair_id").to_pylist() == PEOPLE["pair_id"] * 2
    assert merge(out, one, other, "--prefix-people", "kth", "delft") == 0
    rows = episodes(out).to_pydict()
    assert rows["pair_id"] == ["kth-P01", "kth-P01", "kth-P02", "delft-P01", "delft-P01", "P02"]  # the last: simulated
    assert rows["player_0_id"][:4] == ["kth-P01-a", "kth-P01-b", "kth-P02-a", "delft-P01-a"]
    assert rows["consent_id"] == ["kth-C1", "kth-C1", "", "", "", ""]
    assert rows["session_id"][3:] == ["delft-s1", "delft-s1", "s2"]
    record = json.loads((out / "meta" / "copolicy.json").read_text(encoding="utf-8"))
    assert [part["prefix"] for part in record["merged"]] == ["kth", "delft"]


def test_players_are_compared_across_the_seats(roots, tmp_path, capsys):
    one, other = roots
    blank = {"pair_id": [""] * 3, "consent_id": [""] * 3, "source": ["human"] * 3}
    set_columns(one, **blank, player_0_id=["anna", "", ""], player_1_id=[""] * 3)
    set_columns(other, **blank, player_0_id=[""] * 3, player_1_id=["", "anna", ""])
    assert merge(tmp_path / "out", one, other) == 2
    assert capsys.readouterr().err.startswith("copolicy-convert: player 'anna': expected a name in one of")


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--prefix-people", "kth"], "--prefix-people: expected 2 different names, one for each data set, found"),
        (["--prefix-people", "a", "a"], "--prefix-people: expected 2 different names, one for each data set, found"),
        (["--prefix-people", "a", "b/c"], "--prefix-people: expected names of letters, digits and underscores"),
        (
            ["--repo-id", "both"],
            "--repo-id: expected USER/NAME as the Hub takes it (one slash between user and name), found 'both'",
        ),
    ],
)
def test_a_call_that_cannot_be_met_says_why(made, tmp_path, capsys, flags, message):
    arguments = ["merge", str(made / "a"), str(made / "b"), "--out", str(tmp_path / "x"), "--repo-id", "l/b", *flags]
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
        (lambda info: info.update(fps=15), "expected fps 10, as in {one}, found 15"),
        (
            lambda info: info.update(codebase_version="v3.1"),
            "expected codebase_version 'v3.0', as in {one}, found 'v3.1'",
        ),
        (
            lambda info: info["features"]["action"].update(hold="first"),
            "expected the feature action of {one}, found hold 'first' instead of 'mean'",
        ),
    ],
)
def test_what_does_not_fit_is_refused(roots, tmp_path, capsys, change, message):
    one, other = roots
    change_info(other, change)
    assert merge(tmp_path / "out", one, other) == 2
    told = message.format(one=one)
    assert capsys.readouterr().err == f"copolicy-convert: {other / 'meta' / 'info.json'}: {told}\n"
    assert not (tmp_path / "out").exists()


def test_an_episode_in_both_is_refused(roots, tmp_path, capsys):
    one, other = roots
    shared = episodes(one).column("episode_uuid").to_pylist()[1]
    set_columns(other, episode_uuid=lambda uuids: [uuids[0], shared, uuids[2]])
    assert merge(tmp_path / "out", one, other) == 2
    assert capsys.readouterr().err == (
        f"copolicy-convert: {other}: expected no episode of {one}, found episode_uuid {shared} in both\n"
    )


def test_what_comes_out_changed_is_not_written(roots, tmp_path, capsys, monkeypatch):
    before = contents(tmp_path)
    changed = {"late_ticks": lambda values: [7] * len(values)}
    monkeypatch.setattr(merging, "_restore_episodes", lambda root, expected: set_columns(root, **changed))
    assert merge(tmp_path / "out", *roots) == 1
    error = capsys.readouterr().err
    assert "expected late_ticks unchanged by the merge, found otherwise; nothing was written" in error
    assert contents(tmp_path) == before


def test_an_output_that_is_there_is_left_alone(made, tmp_path, capsys):
    (tmp_path / "out").write_text("mine", encoding="utf-8")
    assert merge(tmp_path / "out", made / "a", made / "b") == 2
    assert "nothing was overwritten" in capsys.readouterr().err
    assert (tmp_path / "out").read_text(encoding="utf-8") == "mine"
