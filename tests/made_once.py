"""Files that a run of the suite makes once for all of its processes, and copies for tests that ask for them."""

import shutil
from collections.abc import Callable
from pathlib import Path

from filelock import FileLock

from copolicy.collect.simulate.command import simulate

store: Path | None = None
"""Folder of the run, of which conftest.py says it; without one everything is made anew."""


_EPISODES = {1: 6, 2: 3, 3: 8, 5: 4, 7: 5, 9: 3}
"""As many as the tests take at most with a seed: fewer are the first of them, see test_simulate.py."""


def made_once(name: str, make: Callable[[Path], object]) -> Path:
    """The folder in which `make` has written what a name stands for; not to be changed."""
    assert store is not None
    made = store / name
    with FileLock(store / f"{name}.lock"):
        if not made.exists():
            partial = store / f"{name}.partial"
            shutil.rmtree(partial, ignore_errors=True)  # of another process that failed
            make(partial)
            partial.rename(made)
    return made


def simulated(folder: Path, episodes: int, seed: int) -> Path:
    """Recordings of simulated pairs over the first set of maps."""
    if store is None:
        simulate(folder, episodes, seed, workers=1)
        return folder
    count = max(episodes, _EPISODES.get(seed, 0))
    made = made_once(f"simulated-{count}-{seed}", lambda new: simulate(new, count, seed, workers=1))
    folder.mkdir(parents=True, exist_ok=True)
    for path in sorted(made.iterdir())[:episodes]:
        shutil.copy2(path, folder)
    return folder
