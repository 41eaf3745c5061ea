"""Flags that say where the tasks of a command run: `--executor`, `--workers`, and those of SLURM and Ray."""

import argparse
import importlib.util
import os
import shutil
import socket
import sys
from dataclasses import dataclass, field
from typing import Any

from ..command_line.flag_numbers import whole_number
from ..exceptions import InvalidValueError

EXECUTORS = ("local", "slurm", "ray")

ADDRESS_VARIABLE = "RAY_ADDRESS"
"""Environment variable with the address of a Ray cluster, read by `ray.init`."""

_ANSWER_S = 10.0


@dataclass(frozen=True)
class SlurmOptions:
    """Options of SLURM jobs.

    Attributes:
        time: time limit of one task's job, in sbatch's format.
        memory_gb: memory of one job.
        setup: shell command that activates the environment in a job; by default activates the current virtual
            environment, which must be visible to the nodes.
        arguments: further options of sbatch, for example `(("account", "lab"),)`.
    """

    partition: str | None = None
    time: str = "01:00:00"
    memory_gb: int = 4
    setup: str | None = None
    arguments: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Distribution:
    """Where the tasks of a command run.

    Attributes:
        executor: `local`, `slurm` or `ray`.
        workers: number of tasks at a time; None for one locally, for all on a cluster.
        slurm: options of SLURM jobs.
        address: of a Ray cluster; None for the cluster of this process, of `RAY_ADDRESS`, or of this machine.
    """

    executor: str = "local"
    workers: int | None = None
    slurm: SlurmOptions = field(default_factory=SlurmOptions)
    address: str | None = None

    def require(self) -> None:
        """Checks that the executor is usable on this machine.

        Raises:
            InvalidValueError: Ray is not installed, nothing answers at its address or that of `RAY_ADDRESS`, sbatch is
                not found, or no partition is given.
        """
        if self.executor == "ray":
            if importlib.util.find_spec("ray") is None:
                expected = "local or slurm, as ray is not installed (pip install ray)"
                raise InvalidValueError("--executor", expected, self.executor)
            stated = stated_address(self.address)
            if stated is not None and not _is_connected():
                _require_answer(*stated)
        if self.executor == "slurm":
            if shutil.which("sbatch") is None:
                raise InvalidValueError("--executor", "sbatch on the PATH, for slurm", "none")
            if not self.slurm.partition:
                expected = "a partition of the cluster, for --executor slurm"
                raise InvalidValueError("--partition", expected, self.slurm.partition)


def add_distribution_flags(group: argparse._ArgumentGroup, task: str) -> None:
    """Adds the flags of `Distribution`.

    Args:
        task: what a task is called in the help, such as shard.
    """
    group.add_argument(
        "--workers",
        type=whole_number("--workers", None, 1024),
        metavar="N",
        help=f"number of {task}s at a time (default: 1; on a cluster: all)",
    )
    group.add_argument("--executor", choices=EXECUTORS, help=f"where {task}s run (default: local)")
    group.add_argument(
        "--address", help="address of a Ray cluster (default: the one of RAY_ADDRESS or of this machine)"
    )
    group.add_argument("--partition", help="SLURM partition")
    group.add_argument("--time", metavar="HH:MM:SS", help=f"time limit of a {task}'s SLURM job (default: 01:00:00)")
    group.add_argument("--memory-gb", type=whole_number("--memory-gb"), metavar="N", help="per SLURM job (default: 4)")
    group.add_argument(
        "--setup", metavar="COMMAND", help="activates the environment of a SLURM job (default: this virtual one)"
    )
    group.add_argument(
        "--sbatch", action="append", metavar="KEY=VALUE", help="further option of sbatch, such as account=lab"
    )


def distribution_from_flags(arguments: argparse.Namespace) -> Distribution:
    """Returns what the flags of `add_distribution_flags` state.

    Raises:
        InvalidValueError: a flag of another executor, or no positive number of workers.
    """
    slurm: dict[str, Any] = {
        name: value
        for name in ("partition", "time", "memory_gb", "setup")
        if (value := getattr(arguments, name)) is not None
    }
    if arguments.sbatch:
        slurm["arguments"] = tuple(_option(text) for text in arguments.sbatch)
    executor = arguments.executor or "local"
    if slurm and executor != "slurm":
        name = next(iter(slurm)).replace("_", "-").replace("arguments", "sbatch")
        raise InvalidValueError(f"--{name}", "--executor slurm beside it", executor)
    if arguments.address is not None and executor != "ray":
        raise InvalidValueError("--address", "--executor ray beside it", executor)
    if arguments.workers is not None and arguments.workers < 1:
        raise InvalidValueError("workers", "at least 1", arguments.workers)
    return Distribution(executor, arguments.workers, SlurmOptions(**slurm), arguments.address)


def stated_address(address: str | None) -> tuple[str, str] | None:
    """The address to which `ray.init` connects, after the flag or the variable that states it; None if neither does.

    Args:
        address: value of `--address`; as in `ray.init`, `RAY_ADDRESS` replaces none and `auto`, but no other.
    """
    variable = os.environ.get(ADDRESS_VARIABLE)
    if variable and address in (None, "auto"):
        return ADDRESS_VARIABLE, variable
    return None if address is None else ("--address", address)


def _is_connected() -> bool:
    """Whether this process is connected to a Ray cluster, which then runs the tasks."""
    return "ray" in sys.modules and sys.modules["ray"].is_initialized()


def _require_answer(name: str, address: str) -> None:
    """Checks that something answers at an address; Ray itself tries for minutes."""
    scheme, _, place = address.rpartition("://")
    if address in ("auto", "local") or scheme not in ("", "ray", "http", "https"):
        return  # of another scheme, such as anyscale://, only Ray's plugin knows the place
    host, colon, port = place.rpartition(":")
    if not colon or not port.isdecimal() or scheme.startswith("http"):  # http is Ray's dashboard, which takes jobs
        raise InvalidValueError(name, "HOST:PORT, ray://HOST:PORT or auto", address)
    try:
        socket.create_connection((host.strip("[]"), int(port)), _ANSWER_S).close()
    except (OSError, OverflowError) as error:
        raise InvalidValueError(name, "a Ray cluster that answers", f"{address}: {error}") from None


def _option(text: str) -> tuple[str, str]:
    key, _, value = text.partition("=")
    if not key or key.startswith("-"):
        raise InvalidValueError("--sbatch", "KEY=VALUE, such as account=lab", text)
    return key, value
