"""Without a display: commands that open a window say so in one line and end; those that need none run."""

import json
import os
import subprocess
import sys

import pytest
from made_once import simulated
from play_session import settings

from copolicy.collect.play.session_run import prepared
from copolicy.collect.sdl import NoDisplayError, init_events, open_display, pygame
from copolicy.dataset.exceptions import RunError

NONE = "neither DISPLAY nor WAYLAND_DISPLAY is set"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded")
    simulated(folder, 1, seed=0)
    return folder / "episode_000000.mcap"


def run(*arguments, module="copolicy.collect.cli", **environment):
    clean = {
        name: text
        for name, text in os.environ.items()
        if not name.startswith("SDL_") and name not in ("DISPLAY", "WAYLAND_DISPLAY", "XDG_RUNTIME_DIR")
    }
    command = [sys.executable, "-m", module, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, env=clean | environment, timeout=120, check=False)


@pytest.mark.parametrize(
    ("environment", "why"), [({}, NONE), ({"DISPLAY": "127.0.0.1:4711"}, "no answer from DISPLAY=127.0.0.1:4711")]
)
def test_play_ends_in_one_line_and_leaves_nothing(tmp_path, environment, why):
    out = tmp_path / "recordings"
    done = run("play", "--out", out, "--players", "scripted", "scripted", "--episodes", "1", **environment)
    assert done.returncode == 1
    assert done.stderr == f"copolicy-collect: expected a display (or --headless), found none: {why}\n"
    assert not out.exists()


def test_a_replay_ends_in_one_line(recording):
    done = run("replay", recording)
    assert done.returncode == 1
    assert done.stderr == f"copolicy-collect: expected a display (or --out FILE), found none: {NONE}\n"


def test_what_needs_no_window_runs(recording, tmp_path):
    assert run("replay", recording, "--out", tmp_path / "a.png").returncode == 0
    done = run("devices", "--json")
    assert (done.returncode, json.loads(done.stdout)) == (0, {"devices": []}), done.stderr


@pytest.fixture
def without_display(monkeypatch):
    for name in ("SDL_VIDEODRIVER", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    pygame.display.quit()
    yield monkeypatch
    pygame.display.quit()


@pytest.mark.parametrize("driver", ["offscreen", "dummy"])
def test_whoever_asks_for_an_invisible_driver_gets_it(without_display, driver):
    without_display.setenv("SDL_VIDEODRIVER", driver)
    open_display()
    assert pygame.display.get_driver() == driver
    assert os.environ["SDL_VIDEODRIVER"] == driver


def test_devices_that_were_listed_ask_for_no_invisible_window(without_display):
    init_events(window=True)
    assert pygame.display.get_driver() == "dummy"
    assert "SDL_VIDEODRIVER" not in os.environ
    with pytest.raises(NoDisplayError, match=NONE):
        open_display()
    assert not pygame.display.get_init()


def test_nothing_is_loaded_where_there_is_no_window(without_display, tmp_path):
    loaded = []
    with (
        pytest.raises(RunError, match="expected a display"),
        prepared(settings(tmp_path), ("the robots", lambda: loaded.append(1))),
    ):
        pass
    assert (loaded, list(tmp_path.iterdir())) == ([], [])
