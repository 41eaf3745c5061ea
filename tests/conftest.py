"""Settings that must hold before any test imports torch, pygame or the Hub client."""

import os
from pathlib import Path

import pytest

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("SDL_AUDIODRIVER", "dummy")
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
# Nothing in the tests may reach for the network; the Hub client reads these at import.
os.environ["HF_HUB_OFFLINE"] = "1"
os.environ["HF_HUB_DISABLE_TELEMETRY"] = "1"


@pytest.fixture(scope="session")
def upstream() -> Path:
    """Files that the original program wrote, and traces of running it."""
    return Path(__file__).parent / "data" / "upstream"


@pytest.fixture(autouse=True, scope="session")
def _private_home(tmp_path_factory):
    """LeRobot and datasets keep their caches in a folder that goes away with the test run."""
    home = tmp_path_factory.mktemp("home")
    os.environ["HF_HOME"] = str(home / "huggingface")
    os.environ["HF_LEROBOT_HOME"] = str(home / "lerobot")
