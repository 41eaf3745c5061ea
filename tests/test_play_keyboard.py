"""A real window and real keys: the program under Xvfb, xdotool at the keyboard."""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from copolicy.dataset.recording.reader import read_episode, read_metadata

_MISSING = [name for name in ("Xvfb", "xdotool", "xkbcomp") if shutil.which(name) is None]
pytestmark = pytest.mark.skipif(
    bool(_MISSING), reason=f"not installed: {', '.join(_MISSING)} (apt-get install xvfb xdotool x11-xkb-utils)"
)


@pytest.fixture(scope="module")
def display():
    """The number of an X server of its own."""
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x800x24", "-nolisten", "tcp", "-noreset"]
    server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as pipe:
        number = pipe.readline().strip()
    yield f":{number}"
    server.terminate()
    server.wait(10)


class Keyboard:
    """Runs the program and types."""

    def __init__(self, display: str, out: Path, *flags: str):
        self.out = out
        self._environment = {
            name: text for name, text in os.environ.items() if name not in ("SDL_VIDEODRIVER", "WAYLAND_DISPLAY")
        } | {"DISPLAY": display, "SDL_AUDIODRIVER": "dummy", "COPOLICY_PROGRESS": "0"}
        command = [sys.executable, "-m", "copolicy.collect.cli", "play", "--pair", "K01", "--out", str(out)]
        command += [
            "--players",
            "keyboard",
            "keyboard",
            "--countdown",
            "0",
            "--json",
            "--config-dir",
            str(out / "config"),
        ]
        self.program = subprocess.Popen(
            [*command, "--seats", "fixed", *flags],
            env=self._environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        try:
            self.window = self._wait_for_window()
        except BaseException:
            self.__exit__()
            raise
        time.sleep(0.3)

    def __enter__(self) -> "Keyboard":
        return self

    def __exit__(self, *_: object) -> None:
        with self.program:
            self.program.kill()

    def _wait_for_window(self) -> str:
        """Without a window manager SDL takes the focus itself."""
        for _ in range(200):
            found = subprocess.run(
                ["xdotool", "getwindowfocus", "getwindowname"], env=self._environment, capture_output=True, text=True
            )
            if "copolicy" in found.stdout:
                return self.do("getwindowfocus").strip()
            if self.program.poll() is not None:
                raise AssertionError(f"the program ended: {self.program.communicate()[1].decode()}")
            time.sleep(0.1)
        raise AssertionError("no window came in 20 s")

    def do(self, *words: str) -> str:
        """One xdotool command."""
        done = subprocess.run(
            ["xdotool", *words], env=self._environment, capture_output=True, text=True, timeout=30, check=True
        )
        return done.stdout

    def key(self, *names: str) -> None:
        """Presses keys one after the other, each long enough for a tick to see it."""
        for name in names:
            self.do("keydown", name)
            time.sleep(0.07)
            self.do("keyup", name)
            time.sleep(0.07)

    def journal(self) -> list[dict]:
        """What the session noted so far."""
        path = self.out / "K01-01" / "journal.jsonl"
        return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []

    def until_part(self, there: bool = True) -> Path | None:
        """Waits for a recording to begin (or to be complete)."""
        limit = time.monotonic() + 20
        while time.monotonic() < limit:
            parts = list(self.out.rglob("*.part"))
            if bool(parts) == there:
                return parts[0] if parts else None
            time.sleep(0.05)
        raise AssertionError(f"no recording began in 20 s; journal: {self.journal()}")

    def finish(self) -> dict:
        """What the program printed."""
        output, errors = self.program.communicate(timeout=30)
        assert self.program.returncode == 0, errors.decode()
        return json.loads(output)


def _start_episode(keyboard: Keyboard) -> None:
    keyboard.key("e", "Return")  # both join
    keyboard.key("e", "Return")  # both agree
    time.sleep(1.2)
    keyboard.key("Return")
    keyboard.until_part()


def test_two_people_on_one_keyboard(display, tmp_path):
    with Keyboard(display, tmp_path, "--window", "900x570") as keyboard:
        _start_episode(keyboard)
        # Both at once, one of them on a diagonal.
        for name in ("d", "Right", "Down"):
            keyboard.do("keydown", name)
        time.sleep(1.0)
        for name in ("d", "Right", "Down"):
            keyboard.do("keyup", name)
        keyboard.key("Escape")  # pause
        keyboard.key("n", "Up", "Return")  # a note, the last of the list: to be written
        keyboard.do("type", "--delay", "60", "good one")
        keyboard.key("Return")
        keyboard.key("F1", "F1")  # the help, and away again
        keyboard.key("Down", "Down", "Down", "Down", "Return")  # quit for now
        summary = keyboard.finish()
        assert summary["ended_by"] == "quit"
        assert summary["discarded"] == 1
        (path,) = tmp_path.rglob("*.mcap")
        episode = read_episode(path)
        pushed = episode.actions[(episode.actions[:, 0] == 1.0) & (episode.actions[:, 2] > 0)]
        assert len(pushed) > 15
        diagonal = pushed[pushed[:, 3] > 0]
        assert len(diagonal) > 15
        np.testing.assert_allclose(diagonal[:, 2:], 0.5**0.5)
        assert episode.meta.controller_0 == episode.meta.controller_1 == "keyboard"
        assert episode.meta.quality_flags.split(",")[:2] == ["interrupted", "paused"]
        assert read_metadata(path)["episode_result"]["notes"] == "discarded: quit; good one"


def test_another_window_in_front_pauses_the_episode(display, tmp_path):
    with Keyboard(display, tmp_path, "--window", "640x420") as keyboard:
        _start_episode(keyboard)
        keyboard.do("windowunmap", keyboard.window)
        time.sleep(0.5)
        keyboard.do("windowmap", "--sync", keyboard.window)
        keyboard.do("windowfocus", "--sync", keyboard.window)
        time.sleep(0.3)
        keyboard.key("Down", "Down", "Down", "Down", "Return")  # the menu of the pause: quit for now
        summary = keyboard.finish()
        assert summary["ended_by"] == "focus_lost"
        (path,) = tmp_path.rglob("*.mcap")
        assert read_episode(path).meta.termination_reason == "focus_lost"


def test_the_window_can_change_its_size(display, tmp_path):
    with Keyboard(display, tmp_path) as keyboard:
        for size in (("500", "700"), ("1270", "400")):
            keyboard.do("windowsize", "--sync", keyboard.window, *size)
            time.sleep(0.4)
            assert keyboard.program.poll() is None
        keyboard.key("Escape")
        assert keyboard.finish()["ended_by"] == "quit"
