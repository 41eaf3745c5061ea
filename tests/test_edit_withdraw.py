"""`copolicy-dataset withdraw`: no trace of a consent id remains, and everything else is unchanged."""

import json
import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from checked_data import EPISODES, contents, set_columns
from edited_data import columns, digests, info, load
from mcap.writer import Writer
from withdrawable_data import withdrawable

from copolicy.dataset.checks.checking import check_dataset
from copolicy.dataset.cli import main
from copolicy.dataset.edit.withdrawal.withdraw import withdraw
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, RunError
from copolicy.dataset.files import replace_folder
from copolicy.dataset.files.replace_folder import finish_interrupted
from copolicy.dataset.publication.minimal_card import is_minimal_card
from copolicy.dataset.recording.reader import read_metadata
from copolicy.dataset.versions.content import read_content
from copolicy.dataset.versions.manifest import Manifest, file_entry
from copolicy.dataset.versions.release import release
from copolicy.dataset.versions.release_record import read_release


@pytest.fixture
def folder(people_set, tmp_path) -> Path:
    return withdrawable(people_set, tmp_path)


def everything(folder: Path) -> bytes:
    return b"\n".join(name.encode() + value for name, value in contents(folder).items())


def test_a_call_without_yes_changes_nothing(folder, capsys):
    before = contents(folder)
    assert main(["withdraw", "C-1", str(folder / "recordings"), str(folder / "set")]) == 0
    out = capsys.readouterr().out
    assert contents(folder) == before
    assert ["would_be_withdrawn", "2"] in [line.split() for line in out.splitlines()]
    assert "nothing was changed; --yes deletes" in out
    assert "super_squash_history" in out
    assert "2 of 8" in out


def test_no_trace_of_withdrawn_episodes_remains(folder, capsys):
    root = folder / "set"
    rows, before = columns(root), digests(root)
    gone, kept = rows[:2], rows[2:]
    assert main(["withdraw", "C-1", str(folder), "--yes"]) == 0
    out = capsys.readouterr().out
    for text in ("copolicy-cards dataset", "copolicy-cards report", "copolicy-dataset check", "copolicy-dataset stats"):
        assert text in out
    left = everything(folder)
    for row in gone:
        for name in ("episode_uuid", "source_sha256"):
            assert row[name].encode() not in left
    # Three bytes may stand anywhere in what is compressed: of tables and recordings the entries are looked at.
    texts = [
        f"{name} {value!r}" for name, value in contents(folder).items() if not name.endswith((".parquet", ".mcap"))
    ]
    texts += [str(read_metadata(path)) for path in folder.rglob("*.mcap")] + [str(row) for row in columns(root)]
    for name in ("C-1", "P01"):
        assert not [text for text in texts if name in text]
    assert [row["episode_uuid"] for row in columns(root)] == [row["episode_uuid"] for row in kept]
    assert {uuid: entry.digest for uuid, entry in digests(root).items()} == {
        row["episode_uuid"]: before[row["episode_uuid"]].digest for row in kept
    }
    assert len(list((folder / "recordings").glob("*.mcap"))) == len(list((root / "raw").glob("*.mcap"))) == 6
    manifest = Manifest.read(root / "raw" / "manifest.json").files
    assert manifest == {path.relative_to(root).as_posix(): file_entry(path) for path in (root / "raw").glob("*.mcap")}
    record = json.loads((root / "meta/copolicy.json").read_text(encoding="utf-8"))
    assert record["notes"] == {kept[0]["episode_uuid"]: ["doubtful"]}
    assert record["left_out"]["discarded"] == ["episode_000099.mcap"]
    assert (root / "LICENSE").read_text(encoding="utf-8") == "a licence"
    assert (root / "notes.txt").read_text(encoding="utf-8") == "lab notes"
    assert is_minimal_card(root / "README.md")
    for name in ("figures", "report.html", "meta/copolicy_stats.json", "meta/copolicy_check.json"):
        assert not (root / name).exists()
    assert sorted(path.name for path in folder.iterdir()) == ["recordings", "set"]


def test_lerobot_and_the_checks_accept_the_rest(folder):
    withdraw("C-1", [folder / "set"], delete=True)
    set_columns(folder / "set", consent_id=["C-3"] * 6)
    assert not check_dataset(folder / "set").failed()
    assert load(folder / "set").num_episodes == info(folder / "set")["total_episodes"] == 6
    assert info(folder / "set")["splits"] == {"train": "0:6"}


def test_the_next_release_counts_withdrawn_episodes_without_names(folder):
    root = folder / "set"
    released = read_release(root).content_hash
    withdraw("C-1", [root], delete=True)
    withdrawals = json.loads((root / "meta/copolicy_withdrawals.json").read_text(encoding="utf-8"))
    (entry,) = withdrawals["withdrawals"]
    assert (entry.keys(), entry["episodes"]) == ({"date", "episodes"}, 2)
    assert read_release(root).content_hash == released  # still readable, and says what was released
    assert read_release(root, "1.0.0").version == "1.0.0"
    with pytest.raises(InvalidValueError, match="major or larger"):
        release(root, "minor", "Fewer.")
    record = release(root, "major", "Fewer.")
    assert record.version == "2.0.0"
    assert "2 episodes removed: withdrawn by people who took part" in record.changes
    log = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    assert "### Removed\n- 2 episodes removed: withdrawn by people who took part" in log
    assert "Sessions of (withdrawn) and P02." in log
    set_columns(root, license=["mit"] * 6)
    assert "withdrawn" not in " ".join(release(root, "patch", "Another licence.").changes)
    withdraw("C-3", [root], delete=True)
    assert "2 episodes removed: withdrawn by people who took part" in release(root, "major", "Fewer.").changes


def test_a_release_is_compared_with_the_remaining_episodes(folder, capsys):
    root = folder / "set"
    withdraw("C-1", [root], delete=True)
    assert main(["diff", f"{root}@1.0.1", str(root)]) == 1
    out = capsys.readouterr().out
    assert "2 episodes removed: withdrawn by people who took part (major)" in out
    assert "added" not in out


def test_the_first_release_counts_earlier_withdrawals(people_set, tmp_path):
    root = Path(shutil.copytree(people_set, tmp_path / "set"))
    withdraw("C-9", [root], delete=True)
    changes = release(root, "minor", "The first.").changes
    assert changes[1] == "1 episode removed: withdrawn by people who took part; no release held them"


def test_a_consent_id_may_cover_several_pairs_and_be_one_of_several(folder):
    withdraw("C-2", [folder / "set", folder / "recordings"], delete=True)
    assert [row["pair_id"] for row in columns(folder / "set")] == ["P02", "P02", "P04", "P04"]
    assert len(list((folder / "recordings").glob("*.mcap"))) == 4


def test_an_amended_consent_id_finds_copies_without_it(folder, people_set):
    """The recordings were made without consent ids, and so was the other data set."""
    other = Path(shutil.copytree(people_set, folder / "other"))
    set_columns(other, consent_id=[""] * 8)
    uuids = [row["episode_uuid"] for row in columns(folder / "set")]
    summary = withdraw("C-9", [folder], delete=True)
    assert (summary["withdrawn"], summary["recordings"], len(summary["data_sets"])) == (1, 1, 2)
    assert uuids[6] not in {row["episode_uuid"] for row in columns(other)}
    assert not (folder / "recordings" / "episode_000006.mcap").exists()


def test_a_set_without_remaining_episodes_is_deleted(folder):
    set_columns(folder / "set", consent_id=["C-5"] * 8)
    summary = withdraw("C-5", [folder / "set"], delete=True)
    assert "no episode is left" in str(summary)
    assert not (folder / "set").exists()


def test_an_interrupted_deletion_is_completed(folder, monkeypatch):
    class Killed(BaseException):
        pass

    def half(path):
        (path / "meta" / "info.json").unlink()
        raise Killed

    set_columns(folder / "set", consent_id=["C-5"] * 8)
    monkeypatch.setattr(replace_folder.shutil, "rmtree", half)
    with pytest.raises(Killed):
        withdraw("C-5", [folder / "set"], delete=True)
    monkeypatch.undo()
    with pytest.raises(FileFormatError, match="no such file or folder"):
        withdraw("C-5", [folder / "set"], delete=True)
    assert [path.name for path in folder.iterdir()] == ["recordings"]


def test_other_files_are_listed_and_kept(folder):
    notes = folder / "recordings" / "notes.md"
    notes.write_text("C-1 was tired", encoding="utf-8")
    (folder / "set" / "notes.txt").write_text("pair P01 again", encoding="utf-8")
    summary = withdraw("C-1", [folder], delete=True)
    assert summary["still_named_in"] == [str(notes)]
    assert summary["data_sets"][str(folder / "set")]["still_named_in"] == ["notes.txt"]
    assert notes.read_text(encoding="utf-8") == "C-1 was tired"


def test_files_are_searched_whatever_their_name_and_length(folder):
    long, odd = folder / "recordings" / "notes.md", folder / "recordings" / "LIST"
    long.write_text("x" * (1 << 20) + " C-1 " + "y" * (1 << 20), encoding="utf-8")
    odd.write_text("P01", encoding="utf-8")
    (folder / "recordings" / "bytes.bin").write_bytes(b"\0C-1 ")
    summary = withdraw("C-1", [folder], delete=True)
    assert summary["still_named_in"] == [str(odd), str(long)]


def test_an_mcap_file_of_another_project_is_not_unreadable(folder, capsys):
    arm = folder / "recordings" / "arm.mcap"
    with arm.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("Joints", "jsonschema", b"{}")
        writer.add_message(writer.register_channel("/joints", "json", schema), 0, b"{}", 0)
        writer.finish()
    assert main(["withdraw", "C-1", str(folder), "--yes", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["of_other_projects"] == [str(arm)]
    assert arm.exists()


def test_columns_of_another_type_are_refused(folder):
    table = pq.ParquetFile(folder / "set" / EPISODES).read()
    column = table.column_names.index("session_id")
    lists = [[text] for text in table.column("session_id").to_pylist()]
    pq.write_table(table.set_column(column, "session_id", pa.array(lists)), folder / "set" / EPISODES)
    with pytest.raises(FileFormatError, match="texts of session_id, found list"):
        withdraw("C-1", [folder / "set"], delete=True)


def test_an_unreadable_recording_is_listed(folder, capsys):
    (folder / "recordings" / "broken.mcap").write_bytes(b"no recording")
    assert main(["withdraw", "C-1", str(folder), "--yes"]) == 1
    assert str(folder / "recordings" / "broken.mcap") in capsys.readouterr().out
    assert len(columns(folder / "set")) == 6


@pytest.mark.parametrize(
    ("consent", "paths", "error", "line"),
    [
        ("C-77", ["set", "recordings"], RunError, "expected an episode with consent id C-77, found none"),
        ("", ["set"], InvalidValueError, "CONSENT_ID: expected one consent id"),
        ("C-1,C-2", ["set"], InvalidValueError, "CONSENT_ID: expected one consent id"),
        ("C-1", ["set", "nowhere"], FileFormatError, "found no such file or folder"),
    ],
)
def test_a_wrong_call_changes_nothing(folder, consent, paths, error, line):
    before = contents(folder)
    with pytest.raises(error, match=line):
        withdraw(consent, [folder / path for path in paths], delete=True)
    assert contents(folder) == before


def test_a_stripped_set_stops_everything(folder):
    other = Path(shutil.copytree(folder / "set", folder / "other"))
    table = pq.ParquetFile(other / EPISODES).read()
    pq.write_table(table.drop_columns(["episode_uuid", "consent_id"]), other / EPISODES)
    before = contents(folder)
    with pytest.raises(FileFormatError, match="--restore-from ORIGINAL"):
        withdraw("C-1", [folder], delete=True)
    assert contents(folder) == before


@pytest.mark.parametrize("stop", ["first", "second"])
def test_an_interruption_leaves_the_old_or_the_new(folder, monkeypatch, stop):
    """Killed between the two renamings, or before the old content is deleted."""
    root = folder / "set"
    before = read_content(root).hash
    calls = []

    class Killed(BaseException):
        pass

    def killed(path):
        calls.append(path)
        raise Killed

    monkeypatch.setattr(replace_folder, "finish_interrupted", lambda root: None)
    if stop == "first":
        monkeypatch.setattr(replace_folder, "sync_tree", lambda path: None)
        real = Path.rename
        monkeypatch.setattr(
            Path, "rename", lambda self, to: killed(self) if self.name.endswith(".partial") else real(self, to)
        )
    else:
        monkeypatch.setattr(replace_folder.shutil, "rmtree", killed)
    with pytest.raises(Killed):
        withdraw("C-1", [root], delete=True)
    monkeypatch.undo()
    finish_interrupted(root)
    assert (read_content(root).hash == before) is (stop == "first")
    if stop == "first":
        withdraw("C-1", [root], delete=True)
    assert len(columns(root)) == 6
    assert sorted(path.name for path in folder.iterdir()) == ["recordings", "set"]


def test_leftovers_of_killed_commands_are_deleted(folder):
    """Also for the parent folder, which contains an interrupted replacement under a hidden name."""
    root = folder / "set"
    shutil.copytree(root, folder / ".set.0123abcd.partial")
    shutil.copytree(root, folder / ".gone.89abcdef.partial")
    root.rename(folder / ".set.before-edit")
    summary = withdraw("C-1", [folder], delete=True)
    assert len(columns(root)) == 6
    assert summary["unfinished"] == [str(folder / ".gone.89abcdef.partial")]
    assert sorted(path.name for path in folder.iterdir()) == [".gone.89abcdef.partial", "recordings", "set"]
