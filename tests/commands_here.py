"""The chain of `run_chain` without a process a command; tests/test_quickstart.py has one chain that starts them."""

import contextlib
import os
import subprocess
from importlib.metadata import entry_points
from pathlib import Path
from types import SimpleNamespace
from typing import IO
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
def commands_here():
    """Chains run their commands in this process until the end of the block."""
    here = SimpleNamespace(Popen=CommandHere, DEVNULL=subprocess.DEVNULL, TimeoutExpired=subprocess.TimeoutExpired)
    with pytest.MonkeyPatch.context() as patch_chain, new_accelerate():
        patch_chain.setattr(quickstart_chain, "subprocess", here)
        yield
