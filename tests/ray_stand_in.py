"""What takes the place of Ray where it is not installed."""

from importlib.machinery import ModuleSpec
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


class ClusterStandIn:
    """What `ray_executor` calls to connect to a cluster, in the place of the package; remembers what it was given.

    Attributes:
        addresses: of each call of `init`.
    """

    def __init__(self, error: Exception | None = None, connected: bool = False):
        """
        Args:
            error: raised by `init`.
            connected: the process is connected before `init`.
        """
        self.addresses: list[str | None] = []
        self._error, self._connected = error, connected
        self.__spec__ = ModuleSpec("ray", None)

    def is_initialized(self) -> bool:
        return self._connected

    def init(self, address: str | None, **options: object) -> None:
        self.addresses.append(address)
        if self._error is not None:
            raise self._error

    def shutdown(self) -> None:
        """Nothing was started."""


def stand_in_ray(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs what is for Ray in this process; a package in `folder` counts as Ray where there is none."""
    if find_spec("ray") is None:
        (folder / "ray").mkdir()
        (folder / "ray" / "__init__.py").write_text("def is_initialized():\n    return False\n", encoding="utf-8")
        monkeypatch.syspath_prepend(folder)
    monkeypatch.setattr(ray_executor, "RayExecutor", _InThisProcess)
