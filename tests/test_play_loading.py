"""The first minute: the window is there before what takes long, and says what that is."""

import subprocess
import sys
import threading
import time

import pytest
from play_session import settings

from copolicy.collect.play import loading as loading_module
from copolicy.collect.play.loading import Loading
from copolicy.collect.play.session_run import prepared
from copolicy.collect.play.settings import PlayerSpec
from copolicy.collect.screen.window import Window
from copolicy.collect.sdl import pygame
from copolicy.dataset.exceptions import RunError

FIRST_WINDOW = """
import sys
from copolicy.collect.cli import main
from copolicy.collect.screen import window

def opened(self, *size):
    heavy = {"torch", "lerobot", "pymunk", "scipy", "mcap", "google.protobuf", "tqdm.auto", "datasets", "pandas"}
    print(sorted(heavy & set(sys.modules)))
    sys.exit(7)

window.Window.__init__ = opened
main(["play", "--players", *sys.argv[1:], "--mute"])
"""


@pytest.fixture
def window():
    pygame.display.quit()
    yield Window((400, 320), fullscreen=False)
    pygame.display.quit()


@pytest.mark.parametrize(
    "players", [("joystick", "keyboard"), ("keyboard", "policy:pretrained"), ("scripted:S02",) * 2]
)
def test_the_window_opens_before_anything_heavy_is_imported(players, tmp_path):
    command = [sys.executable, "-c", FIRST_WINDOW, *players]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=120, check=False)
    assert (done.returncode, done.stdout) == (7, "[]\n"), done.stderr


def test_the_window_says_what_is_loaded_and_goes_on_drawing(window, monkeypatch):
    texts = []
    monkeypatch.setattr(loading_module.Canvas, "text", lambda self, text, *rest: texts.append(text))
    loading = Loading(window)
    threads = []

    def job(result):
        threads.append(threading.current_thread())
        time.sleep(0.2)
        return result

    assert loading.run("the table", lambda: job(4)) == 4
    assert loading.run("the policy", lambda: job(5)) == 5
    assert texts.count("loading the table") > 2
    assert texts.index("loading the policy") < texts.index("the table: done")
    assert threading.main_thread() not in threads


def test_an_error_of_what_is_loaded_is_that_of_the_session(window):
    def job():
        raise RunError("expected a policy, found none")

    with pytest.raises(RunError, match="expected a policy, found none"):
        Loading(window).run("the policy", job)


def test_closing_the_window_does_not_wait(window):
    gate = threading.Event()
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    with pytest.raises(RunError, match="the session was ended before it began"):
        Loading(window).run("the policy", lambda: gate.wait(20))
    gate.set()


def test_without_a_window_jobs_simply_run():
    assert Loading(None).run("the policy", threading.current_thread) is threading.main_thread()


def test_a_session_is_loaded_under_its_window_and_named_once_it_is_there(tmp_path, monkeypatch):
    seen = []
    drawn = Loading._draw
    monkeypatch.setattr(
        Loading,
        "_draw",
        lambda self, *rest: (seen.append((rest[1], pygame.display.get_caption()[0])), drawn(self, *rest)),
    )
    players = (PlayerSpec("scripted", "S01"), PlayerSpec("keyboard"))
    with prepared(settings(tmp_path, players=players), ("the robots", list)):
        assert pygame.display.get_caption()[0].startswith("copolicy")
    steps = list(dict.fromkeys(what for what, _ in seen))
    assert steps == [
        "the task table and the recorder",
        "the robots",
        "interrupted recordings",
        "the players",
        "earlier episodes",
    ]
    assert {title for _, title in seen} == {"loading: carry the table together"}
