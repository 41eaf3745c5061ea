"""What takes the place of Ray where it is not installed."""

from importlib.util import find_spec
from pathlib import Path

import pytest

from copolicy.dataset.distributed import ray_executor
from copolicy.dataset.distributed.executors import LocalExecutor
from copolicy.dataset.distributed.job import Job


class _InThisProcess(LocalExecutor):
    """Takes what `RayExecutor` takes, and runs one rank after the other here."""

    def __init__(self, job: Job, workers: int | None, address: str | None):
        super().__init__(job, 1)


def stand_in_ray(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs what is for Ray in this process; an empty package in `folder` counts as Ray where there is none."""
    if find_spec("ray") is None:
        (folder / "ray").mkdir()
        (folder / "ray" / "__init__.py").touch()
        monkeypatch.syspath_prepend(folder)
    monkeypatch.setattr(ray_executor, "RayExecutor", _InThisProcess)
