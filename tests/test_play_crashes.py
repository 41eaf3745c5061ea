"""What is left when the program is stopped, killed, or has no room to write."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from mcap.reader import make_reader

from copolicy.collect.recording.recover import recover
from copolicy.dataset.recording.messages.copolicy_pb2 import LoopTiming
from copolicy.dataset.recording.reader import read_episode


def _command(out: Path, *flags: str) -> list[str]:
    command = [sys.executable, "-m", "copolicy.collect.cli", "play", "--pair", "P01", "--out", str(out), "--json"]
    return [*command, "--players", "scripted", "scripted", "--headless", "--countdown", "0", *flags]


def _start(out: Path, *flags: str, seconds: float = 2.0, limit: int | None = None) -> subprocess.Popen:
    """Starts the program and lets its first episode run for a while."""

    def limited() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    before = set(out.rglob("*.part"))
    program = subprocess.Popen(
        _command(out, *flags),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=limited,
        # Python takes what fits into a limited file for a whole `.pyc`.
        env=os.environ | ({"PYTHONDONTWRITEBYTECODE": "1"} if limit else {}),
    )
    end = time.monotonic() + 60
    while set(out.rglob("*.part")) <= before:
        if time.monotonic() > end or program.poll() is not None:
            program.kill()
            raise AssertionError(f"no recording began: {program.communicate()}")
        time.sleep(0.02)
    time.sleep(seconds)
    return program


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_stopped_program_completes_its_episode(tmp_path, number):
    with _start(tmp_path) as program:
        program.send_signal(number)
        output, errors = program.communicate(timeout=20)
    assert (program.returncode, errors) == (0, "")
    summary = json.loads(output)
    assert (summary["ended_by"], summary["complete"]) == (number.name, False)
    (path,) = tmp_path.rglob("*.mcap")
    assert not list(tmp_path.rglob("*.part"))
    episode = read_episode(path)
    assert len(episode.actions) > 40
    assert (episode.meta.termination_reason, episode.meta.discarded) == ("operator_discard", True)
    assert "interrupted" in episode.meta.quality_flags


def test_a_killed_program_loses_a_second_and_the_next_start_recovers(tmp_path):
    with _start(tmp_path, seconds=2.5) as program:
        killed = time.monotonic_ns()
        program.kill()
        program.communicate()
    (part,) = tmp_path.rglob("*.part")
    before = part.read_bytes()
    with _start(tmp_path, seconds=0.2) as program:
        program.terminate()
        program.communicate(timeout=20)
    (recovered,) = tmp_path.rglob("*.recovered.mcap")
    episode = read_episode(recovered)
    assert episode.meta.termination_reason == "crash_recovered"
    with recovered.open("rb") as file:
        starts = [
            LoopTiming.FromString(message.data).start_ns
            for _, _, message in make_reader(file).iter_messages(["/loop/timing"])
        ]
    assert 0 <= killed - max(starts) < 1.3e9
    assert part.read_bytes() == before
    sessions = {path.parent for path in tmp_path.rglob("*.mcap")}
    assert len(sessions) == 1, "the session went on in its folder"


def _expect_no_room(output: str, errors: str, program: subprocess.Popen) -> None:
    assert output == ""
    assert program.returncode == 1
    last = errors.strip().splitlines()[-1]
    assert last.startswith("copolicy-collect: ")
    assert "expected space for recordings and answers, found: " in last
    assert "finished episodes and saved answers are complete, an unfinished episode is kept as .part" in last


def test_a_file_that_cannot_grow_ends_the_session_with_a_message(tmp_path):
    # The limit of a file's size stands in for a full disk wherever no disk can be mounted.
    with _start(tmp_path, seconds=0, limit=60_000) as program:
        output, errors = program.communicate(timeout=60)
    _expect_no_room(output, errors, program)
    assert "File too large" in errors
    (part,) = tmp_path.rglob("*.part")
    (recovery,) = recover(tmp_path)
    assert recovery.status == "recovered"
    assert recovery.steps > 30
    assert part.exists()


@pytest.fixture
def mounted(tmp_path):
    """Mounts a small file system of its own, where that is allowed."""
    folder = tmp_path / "disk"
    folder.mkdir()

    def mount(options: str) -> Path:
        if os.geteuid() != 0:
            pytest.skip("mounting a file system needs root")
        done = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)], capture_output=True, text=True
        )
        if done.returncode:
            pytest.skip(f"mounting a file system is not permitted here: {done.stderr.strip()}")
        return folder

    yield mount
    if os.path.ismount(folder):
        subprocess.run(["umount", str(folder)], check=True)


def test_a_full_disk_leaves_finished_episodes_alone(mounted):
    disk = mounted("size=400k")
    with _start(disk, seconds=0) as program:
        # Room for the present episode but not for the next; a second file is there first.
        time.sleep(1)
        filler = disk / "filler"
        free = os.statvfs(disk).f_bavail * os.statvfs(disk).f_frsize
        filler.write_bytes(b"x" * max(0, free - 20_000))
        output, errors = program.communicate(timeout=60)
    _expect_no_room(output, errors, program)
    assert "No space left on device" in errors
    filler.unlink()
    results = recover(disk)
    assert [result.status for result in results] == ["recovered"]
    assert read_episode(str(results[0].output)).meta.termination_reason == "crash_recovered"


def test_a_read_only_folder_is_named_before_anything_begins(mounted):
    disk = mounted("size=100k,ro")
    done = subprocess.run(_command(disk / "recordings"), capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert done.stderr.strip() == (
        f"copolicy-collect: {disk / 'recordings'}: expected a folder to write to, found: Read-only file system"
    )
