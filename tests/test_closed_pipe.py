"""A reader that closes the pipe, such as `head`: every command completes without an error."""

import os
import subprocess
import sysconfig
from pathlib import Path

import pytest

SCRIPTS = Path(sysconfig.get_path("scripts"))


def _closed() -> int:
    """The writing end of a pipe whose reading end is closed."""
    reading, writing = os.pipe()
    os.close(reading)
    return writing


def _status(call: list[str], unbuffered: bool = False) -> tuple[int, str]:
    """Exit status of a call whose stdout is a closed pipe, and its stderr."""
    stdout = _closed()
    environment = {**os.environ, "PYTHONUNBUFFERED": "1" if unbuffered else ""}
    try:
        done = subprocess.run(
            [SCRIPTS / call[0], *call[1:]], stdout=stdout, stderr=subprocess.PIPE, text=True, env=environment
        )
    finally:
        os.close(stdout)
    return done.returncode, done.stderr


@pytest.mark.parametrize("unbuffered", [False, True])
@pytest.mark.parametrize(
    ("call", "status"),
    [
        (["copolicy-dataset", "check", "--rules"], 0),
        (["copolicy-dataset", "check", "--help"], 0),
        (["copolicy-eval", "--version"], 0),
    ],
)
def test_a_closed_pipe_gives_no_error(call, status, unbuffered):
    assert _status(call, unbuffered) == (status, "")


def test_a_command_with_a_closed_pipe_completes(sound_recordings, tmp_path):
    assert _status(["copolicy-dataset", "check", str(sound_recordings), "--strict"], unbuffered=True) == (1, "")
    out = tmp_path / "simulated"
    assert _status(["copolicy-collect", "simulate", "--episodes", "1", "--workers", "1", "--out", str(out)]) == (0, "")
    assert [path.name for path in out.iterdir()] == ["episode_000000.mcap"]


def test_a_closed_stderr_gives_no_error(tmp_path):
    stderr = _closed()
    try:
        done = subprocess.run(
            [SCRIPTS / "copolicy-dataset", "check", tmp_path / "nothing"], stdout=subprocess.PIPE, stderr=stderr
        )
    finally:
        os.close(stderr)
    assert (done.returncode, done.stdout) == (2, b"")
