"""`copolicy-dataset withdraw` of recordings: their sessions, links to them, and the list of what would be removed."""

import json
import shutil
from pathlib import Path

import pytest
from checked_data import set_columns
from edited_data import columns
from withdrawable_data import withdrawable

from copolicy.dataset.cli import main
from copolicy.dataset.edit.withdrawal.withdraw import withdraw


@pytest.fixture
def folder(people_set, tmp_path) -> Path:
    return withdrawable(people_set, tmp_path)


def test_recordings_in_every_state(folder):
    recordings = folder / "recordings"
    files = [recordings / f"episode_00000{number}.mcap" for number in range(4)]
    os_part = files[0].rename(f"{files[0]}.part")
    undone = files[1].rename(f"{files[1]}.undone")
    (recordings / "deeper").mkdir()
    moved = files[2].rename(recordings / "deeper" / "any name.mcap")
    (recordings / "._episode_000003.mcap").write_bytes(b"macOS")
    shutil.rmtree(folder / "set" / "raw")
    withdraw("C-1", [folder], delete=True)
    assert not os_part.exists()
    assert not undone.exists()
    assert moved.exists()
    withdraw("C-3", [folder], delete=True)
    assert not moved.exists()
    assert not files[3].exists()
    assert not (recordings / "._episode_000003.mcap").exists()


def test_targets_of_linked_recordings_are_deleted(folder):
    elsewhere = folder / "disk"
    (folder / "recordings").rename(elsewhere)
    (folder / "recordings").symlink_to(elsewhere)
    withdraw("C-3", [folder / "set", folder / "recordings"], delete=True)
    assert len(list(elsewhere.glob("*.mcap"))) == 6


ANSWERS = (("effort", ""), ("performance", "C-3"))


def make_sessions(folder: Path) -> Path:
    """Sessions of two pairs with journal and answers, of episodes 0 and 1 (`P01`), 2 and 6 (`P02`)."""
    out = folder / "sessions"
    for pair, numbers in (("P01", (0, 1)), ("P02", (2, 6))):
        session = out / f"{pair}-01"
        session.mkdir(parents=True)
        for number in numbers:
            shutil.copy(folder / "recordings" / f"episode_00000{number}.mcap", session / f"episode_{number:03d}.mcap")
        (session / "session.json").write_text(json.dumps({"pair_id": pair}), encoding="utf-8")
        lines = [
            {"event": "ready", "player": f"{pair}-a", "consent": "C-3"},
            {"event": "keep", "file": f"episode_{numbers[0]:03d}.mcap"},
            {"event": "keep", "file": f"episode_{numbers[1]:03d}.mcap"},
        ]
        text = "".join(json.dumps(line) + "\n" for line in lines)
        (session / "journal.jsonl").write_text(text, encoding="utf-8")
        lines = [{"participant": "other", "item": item, "consent": consent} for item, consent in ANSWERS]
        text = "".join(json.dumps(line) + "\n" for line in lines)
        (session / "answers.jsonl").write_text(text, encoding="utf-8")
    return out


def test_a_session_is_deleted_with_its_last_recording(folder):
    out = make_sessions(folder)
    withdraw("C-1", [folder / "set", out], delete=True)
    assert [path.name for path in out.iterdir()] == ["P02-01"]
    withdraw("C-3", [folder / "set", out], delete=True)
    journal = (out / "P02-01" / "journal.jsonl").read_text(encoding="utf-8").splitlines()
    assert [json.loads(line)["file"] for line in journal] == ["episode_006.mcap"]
    answers = (out / "P02-01" / "answers.jsonl").read_text(encoding="utf-8").splitlines()
    assert [json.loads(line)["item"] for line in answers] == ["effort"]


def entries(folder: Path) -> dict[Path, bytes | None]:
    """Files, folders and links below a folder, except tables of frames; None for what is no file."""
    found = {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}
    return {path: content for path, content in found.items() if folder / "set" / "data" not in path.parents}


@pytest.mark.parametrize("consent", ["C-1", "C-2", "C-3", "C-5"])
def test_a_call_without_yes_lists_all_that_would_be_removed(folder, consent):
    out = make_sessions(folder)
    (out / "P01-01" / ".copolicy.lock").touch()
    (out / "P02-01" / "._episode_002.mcap").write_bytes(b"macOS")
    (folder / "set" / "raw" / "._episode_000002.mcap").write_bytes(b"macOS")
    (folder / "set" / ".cache").mkdir()
    (folder / "set" / ".cache" / "episode_000000.mcap.metadata").touch()
    (folder / ".set.0123abcd.partial").mkdir()
    (folder / "linked").mkdir()
    (folder / "linked" / "any name.mcap").symlink_to(folder / "recordings" / "episode_000002.mcap")
    if consent == "C-5":
        set_columns(folder / "set", consent_id=["C-5"] * 8)
    paths = [folder / name for name in ("linked", "set", "recordings", "sessions")]
    before = entries(folder)
    planned = withdraw(consent, paths)
    assert entries(folder) == before
    done = withdraw(consent, paths, delete=True)
    after = entries(folder)
    listed = {Path(name) for name in planned["files"]}
    gone = before.keys() - after.keys()
    assert {path for path in gone if not listed & {path, *path.parents}} == set()
    assert {path.relative_to(folder).as_posix() for path in listed - gone} <= {"set/README.md"}  # the minimal card
    counts = {
        str(path): f"{len(content.splitlines()) - len(left.splitlines())} of {len(content.splitlines())}"
        for path, content in before.items()
        if path.suffix == ".jsonl" and content and (left := after.get(path)) is not None and left != content
    }
    assert planned.get("lines", {}) == counts
    for name, facts in planned["data_sets"].items():
        assert facts.items() <= done["data_sets"][name].items()


def test_answers_that_would_be_removed_are_counted(folder, capsys):
    out = make_sessions(folder)
    assert main(["withdraw", "C-3", str(folder / "set"), str(out)]) == 0
    told = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [str(out / "P02-01" / "answers.jsonl"), "1", "of", "2"] in told
    assert [str(out / "P02-01" / "journal.jsonl"), "2", "of", "3"] in told


def test_the_recording_behind_a_linked_raw_copy_is_deleted_with_its_session(folder):
    """The link is gone when the data set is rewritten; the recording, visited through it, must not stay."""
    out = make_sessions(folder)
    for number in (0, 1):
        raw = folder / "set" / "raw" / f"episode_00000{number}.mcap"
        raw.unlink()
        raw.symlink_to(out / "P01-01" / f"episode_{number:03d}.mcap")
    shutil.rmtree(folder / "recordings")
    withdraw("C-1", [folder / "set", out], delete=True)
    assert [path.name for path in out.iterdir()] == ["P02-01"]


def test_a_linked_session_is_deleted_with_its_link(folder):
    out = make_sessions(folder)
    (out / "P01-01").rename(folder / "disk")
    (out / "P01-01").symlink_to(folder / "disk")
    withdraw("C-1", [folder / "set", out], delete=True)
    assert [path.name for path in out.iterdir()] == ["P02-01"]
    assert not (folder / "disk").exists()


@pytest.mark.parametrize("before", [".mcap", ".jsonl"])
def test_an_interrupted_call_is_completed_by_the_next(folder, monkeypatch, before):
    """The consent ids are in the data set only, which is therefore rewritten last."""

    class Killed(BaseException):
        pass

    real = Path.unlink

    def killed(path, **options):
        if path.suffix == before:
            raise Killed
        real(path, **options)

    out = make_sessions(folder)
    (out / "P01-01" / "video.mp4").touch()
    monkeypatch.setattr(Path, "unlink", killed)
    with pytest.raises(Killed):
        withdraw("C-1", [folder / "set", out], delete=True)
    monkeypatch.undo()
    withdraw("C-1", [folder / "set", out], delete=True)
    assert [path.name for path in (out / "P01-01").iterdir()] == ["video.mp4"]
    assert [row["pair_id"] for row in columns(folder / "set")][:2] == ["P02", "P02"]
