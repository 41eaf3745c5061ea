"""The chain of `run_chain` in less time: its commands in this process, or in processes that have imported LeRobot."""

import contextlib
import os
import subprocess
from collections.abc import Callable, Iterator
from importlib.metadata import entry_points
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any
from unittest.mock import patch

import pytest
from training_table import new_accelerate

from copolicy.train import quickstart_chain


class CommandHere:
    """Stands for the process of a command: its entry point is called in this one, which has imported LeRobot."""

    def __init__(self, command: list[str], env: dict[str, str], stdin: int, stdout: IO[str], stderr: IO[str]):
        (entry,) = entry_points(group="console_scripts", name=Path(command[0]).name)
        with patch.dict(os.environ, env), contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
            self.status = entry.load()(command[1:])
        stdout.flush()

    def __enter__(self) -> "CommandHere":
        return self

    def __exit__(self, *_) -> None:
        pass

    def wait(self, timeout: float | None = None) -> int:
        return self.status


@contextlib.contextmanager
def commands_here() -> Iterator[None]:
    """Chains run their commands in this process until the end of the block."""
    with _starting(CommandHere), new_accelerate():
        yield


@contextlib.contextmanager
def commands_in(python: list[str]) -> Iterator[None]:
    """Chains run each command in a process of its own, by this Python instead of that of its first line."""

    def start(command: list[str], **settings: Any) -> subprocess.Popen:
        return subprocess.Popen([*python, *command], **settings)

    with _starting(start):
        yield


@contextlib.contextmanager
def _starting(start: Callable[..., Any]) -> Iterator[None]:
    replaced = SimpleNamespace(Popen=start, DEVNULL=subprocess.DEVNULL, TimeoutExpired=subprocess.TimeoutExpired)
    with pytest.MonkeyPatch.context() as patch_chain:
        patch_chain.setattr(quickstart_chain, "subprocess", replaced)
        yield
