"""Processes that share work: Ctrl-C at any moment is one line, and nobody outlives a command that was killed."""

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

from copolicy.dataset.worker_pool import WorkerPool

CALLS = {
    "simulate": ["collect", "simulate", "--episodes", "200", "--workers", "2", "--out", "{new}"],
    "mcap": [
        *("convert", "mcap", "{recordings}", "--workers", "2", "--no-drift"),
        *("--repo-id", "lab/table", "--out", "{new}"),
    ],
}


@pytest.fixture
def started(unsharded, tmp_path):
    """Starts a command in a group of processes of its own, as a terminal does."""
    running = []

    def start(name: str) -> subprocess.Popen:
        paths = {"new": tmp_path / "new", "recordings": unsharded / "recordings"}
        room, *flags = (part.format(**paths) for part in CALLS[name])
        command = [sys.executable, "-c", f"from copolicy.{room}.cli import main; raise SystemExit(main())", *flags]
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
        )
        running.append(process)
        return process

    yield start
    for process in running:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def workers_of(process: subprocess.Popen) -> list[psutil.Process]:
    """Its processes that do the work, and not the one that watches over semaphores."""
    children = psutil.Process(process.pid).children()
    return [child for child in children if "spawn_main" in " ".join(child.cmdline())]


def wait_for_workers(process: subprocess.Popen) -> list[psutil.Process]:
    while not (found := workers_of(process)):
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    return found


@pytest.mark.parametrize("name", CALLS)
def test_ctrl_c_while_workers_are_importing_is_one_line(started, name):
    process = started(name)
    wait_for_workers(process)
    time.sleep(0.2)
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=120)
    assert (process.returncode, errors) == (130, f"copolicy-{CALLS[name][0]}: stopped\n")


def test_workers_end_with_a_command_that_is_killed(started):
    process = started("simulate")
    workers = wait_for_workers(process)
    process.kill()
    _, alive = psutil.wait_procs(workers, timeout=60)
    assert not alive


def test_a_pool_takes_the_initializer_and_gives_results_in_order():
    with WorkerPool(2, os.putenv, ("COPOLICY_WORD", "said")) as pool:
        assert list(pool.map(abs, (-3, -1, -2))) == [3, 1, 2]
        assert pool.submit(signal.getsignal, signal.SIGINT).result() == signal.SIG_IGN
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
