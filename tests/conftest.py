"""Settings that must hold before any test imports torch, pygame or the Hub client, and fixtures of several files.

Fixtures import their builders when they are asked for: torch, LeRobot and Playwright take seconds.
"""

import logging
import os
import shutil
import signal
import sys
from pathlib import Path

import pytest

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("SDL_AUDIODRIVER", "dummy")
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
# Nothing in the tests may reach for the network; the Hub client reads these at import.
os.environ["HF_HUB_OFFLINE"] = "1"
os.environ["HF_HUB_DISABLE_TELEMETRY"] = "1"

# A shell without job control has background jobs ignore SIGINT, and every program under test would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


_FEW_FILES = 3
_LONGEST_SOCKET_FOLDER = 90  # characters: the system refuses names of sockets of more than 107


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int | None:
    """No further process for a few named files: each would import torch and LeRobot before its first test."""
    named = {argument.partition("::")[0] for argument in config.invocation_params.args if ".py" in argument}
    return 0 if 0 < len(named) <= _FEW_FILES else None


# First, so that no core waits for another at the end; the first two do not wait for the same importer of LeRobot.
_LONG_FILES = (
    "test_quickstart.py", "test_scripted_players.py", "test_train_hub.py", "test_convert_scale_restart.py",
    "test_train_distributed.py", "test_convert_scale_slurm.py", "test_damaged_sets.py", "test_simulate.py",
    "test_policy_fast_planning.py", "test_sweep_executors.py", "test_recover.py",
)  # fmt: skip


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Puts the tests of the long files first."""
    places = {name: place for place, name in enumerate(_LONG_FILES)}
    items.sort(key=lambda item: places.get(item.path.name, len(places)))


@pytest.fixture(scope="session")
def upstream() -> Path:
    """Files that the original program wrote, and traces of running it."""
    return Path(__file__).parent / "data" / "upstream"


@pytest.fixture(scope="session")
def examples(upstream) -> Path:
    """Episodes that scripted players recorded with the original program, in its three formats."""
    return upstream / "examples_scripted"


@pytest.fixture(autouse=True, scope="session")
def _private_home(tmp_path_factory):
    """LeRobot and datasets keep their caches in a folder that goes away with the test run."""
    home = tmp_path_factory.mktemp("home")
    os.environ["HF_HOME"] = str(home / "huggingface")
    os.environ["HF_LEROBOT_HOME"] = str(home / "lerobot")


@pytest.fixture(autouse=True, scope="session")
def run_folder(tmp_path_factory) -> Path:
    """A folder that all processes of a run share, see `made_once.py`."""
    import made_once

    folder = tmp_path_factory.getbasetemp()
    made_once.store = folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder
    return made_once.store


@pytest.fixture(autouse=True, scope="session")
def _computed_once():
    """What LeRobot's libraries would compute again in every test; collecting has imported them where one needs them."""
    from computed_once import computed_once

    with pytest.MonkeyPatch.context() as patch:
        computed_once(patch)
        yield


@pytest.fixture(scope="session")
def warm_python(run_folder) -> list[str]:
    """The start of a command line of a new Python process that has imported LeRobot already, see `warm_python.py`."""
    if not sys.platform.startswith("linux") or len(str(run_folder)) > _LONGEST_SOCKET_FOLDER:
        return [sys.executable]
    from filelock import FileLock
    from warm_python import warm_python

    run = os.getppid() if "PYTEST_XDIST_WORKER" in os.environ else os.getpid()
    with FileLock(run_folder / "importer.lock"):
        return warm_python(run_folder, run)


@pytest.fixture(autouse=True)
def _logging_as_found():
    """LeRobot's training opens the root logger for the whole process, here or in a fixture of a wider scope."""
    root = logging.getLogger()
    root.setLevel(logging.WARNING)
    handlers = list(root.handlers)
    yield
    for handler in set(root.handlers) - set(handlers):
        root.removeHandler(handler)


@pytest.fixture(params=["stand-in", "ray"])
def ray(request, monkeypatch, tmp_path_factory):
    """Ray itself where it is installed, and the local executor in its place; no cluster in the environment."""
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    if request.param == "ray":
        pytest.importorskip("ray")
        return
    from ray_stand_in import stand_in_ray

    stand_in_ray(tmp_path_factory.mktemp("packages"), monkeypatch)


@pytest.fixture
def own_joysticks():
    """SDL's joysticks and display from nothing, and nothing left of them."""
    from copolicy.collect.sdl import pygame

    def quit_both() -> None:
        pygame.joystick.quit()
        pygame.display.quit()

    quit_both()
    pygame.display.init()
    pygame.joystick.init()
    yield
    quit_both()


@pytest.fixture(scope="session")
def sound_recordings(tmp_path_factory) -> Path:
    """Six recordings of scripted pairs."""
    from checked_data import make_recordings

    return make_recordings(tmp_path_factory.mktemp("checks") / "recordings")


@pytest.fixture(scope="session")
def recorded(sound_recordings):
    """Six recordings as the rules of `check` see them."""
    from copolicy.dataset.checks.checking import read_data

    return read_data(sound_recordings)


@pytest.fixture(scope="session")
def sound(sound_recordings):
    """The data set of these recordings as the rules of `check` see it."""
    from checked_data import make_data_set

    from copolicy.dataset.checks.checking import read_data

    return read_data(make_data_set(sound_recordings, sound_recordings.parent / "set"))


@pytest.fixture(scope="session")
def recording(tmp_path_factory) -> Path:
    """A recording of a straight carry, not to be changed."""
    from straight_carry import record

    return record(tmp_path_factory.mktemp("replay") / "episode.mcap")


@pytest.fixture(scope="session")
def track(recording):
    """That recording as replay reads it."""
    from copolicy.collect.replay.track import read_track

    return read_track(recording)


@pytest.fixture(scope="session")
def people_set(tmp_path_factory) -> Path:
    """Episodes of the pairs P01 to P04, two each, which say that people played them; not to be changed."""
    from edited_data import make_people

    return make_people(tmp_path_factory.mktemp("people"))


@pytest.fixture(scope="session")
def unsharded(tmp_path_factory) -> Path:
    """Simulated recordings in `recordings`, and the data set that they become in one go in `whole`."""
    from checked_data import make_data_set, make_recordings
    from sharded_calls import EPISODES

    folder = tmp_path_factory.mktemp("unsharded")
    make_data_set(make_recordings(folder / "recordings", EPISODES, seed=3), folder / "whole")
    return folder


@pytest.fixture(scope="session")
def random_table(tmp_path_factory) -> Path:
    """A small data set of random frames to train on."""
    from training_table import write_table

    return write_table(tmp_path_factory.mktemp("data") / "table")


@pytest.fixture
def copied_table(random_table, tmp_path) -> Path:
    """The same, to be changed."""
    return Path(shutil.copytree(random_table, tmp_path / "copied_table"))


@pytest.fixture(scope="session")
def _report_sets() -> dict[int, Path]:
    """Data sets of `report_set` by their number of episodes."""
    return {}


@pytest.fixture(scope="module")
def report_set(request, tmp_path_factory, _report_sets) -> Path:
    """A data set of as many simulated episodes as `EPISODES` of the file of tests says."""
    from report_page import make_data_set

    episodes = request.module.EPISODES
    if episodes not in _report_sets:
        _report_sets[episodes] = make_data_set(tmp_path_factory.mktemp("report"), episodes)
    return _report_sets[episodes]


@pytest.fixture(scope="module")
def report(report_set) -> Path:
    """The page of that data set."""
    from report_page import REPORT, make_report

    return report_set / REPORT if (report_set / REPORT).exists() else make_report(report_set)


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """A headless Chromium."""
    from report_page import chromium

    with chromium(tmp_path_factory.mktemp("profile")) as context:
        yield context


@pytest.fixture
def visit(browser):
    """A visit of that browser, see `report_page.visiting`."""
    from report_page import visiting

    with visiting(browser) as visit:
        yield visit


@pytest.fixture
def peg(monkeypatch):
    """A task of another package, installed as far as Python can tell, here and in the commands that a test starts."""
    from copolicy.dataset.task import get_task, load_task

    folder = str(Path(__file__).parent / "peg_task")
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, (folder, os.environ.get("PYTHONPATH")))))
    yield get_task("peg")
    load_task.cache_clear()
