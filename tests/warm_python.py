"""Programs in new processes that need not import LeRobot, which takes ten seconds: forked from one that has.

| process | what it does |
|---|---|
| the importer | imports `IMPORTED`, once for all workers of a test run; waits at a socket; ends after the test run |
| the caller | stands where the program would; arguments, environment, folder and the three streams are the program's |
| a program | is forked from the importer for a caller, which waits for it and ends with its status |

Nothing of ours is imported in the importer, and of LeRobot nothing is registered there that its own modules do not.
"""

import importlib
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
import traceback
from pathlib import Path
from types import ModuleType

IMPORTED = (
    "torch", "accelerate", "datasets", "datatrove.executor", "matplotlib.figure", "numba", "pandas", "pyarrow.parquet",
    "scipy.stats", "lerobot.datasets", "lerobot.envs", "lerobot.policies", "lerobot.policies.factory",
    "lerobot.scripts.lerobot_train",
)  # fmt: skip


def warm_python(folder: Path, run: int) -> list[str]:
    """The start of a command line that takes the place of Python's: `-c`, `-m` or a script, and arguments follow.

    Args:
        folder: of the test run, where the importer's socket lies; it is started if there is none.
        run: process id of the test run, which the importer does not outlive.
    """
    address = folder / "importer"
    if not address.exists():
        # It goes on in the background once it listens.
        subprocess.run([sys.executable, __file__, "import", str(address), str(run)], check=True)
    return [sys.executable, "-I", "-S", __file__, "call", str(address)]


def call(address: str, arguments: list[str]) -> int:
    """Has a program run, and returns its exit status."""
    with socket.socket(socket.AF_UNIX) as importer:
        importer.connect(address)
        wanted = json.dumps({"arguments": arguments, "environment": dict(os.environ), "folder": os.getcwd()})
        socket.send_fds(importer, [b"f"], [0, 1, 2])
        importer.sendall(wanted.encode() + b"\n")
        return int(importer.makefile().readline() or 1)


def listen(address: str, run: int) -> None:
    """Imports, and forks a process for each call until the test run is over."""
    for name in IMPORTED:
        importlib.import_module(name)
    server = socket.socket(socket.AF_UNIX)
    server.bind(address)
    server.listen()
    if os.fork():
        os._exit(0)
    os.setsid()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # whoever serves a call is waited for by nobody
    while _is_running(run):
        if select.select([server], [], [], 1.0)[0]:
            caller, _ = server.accept()
            if os.fork() == 0:
                server.close()
                _serve(caller)
                return
            caller.close()


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def _serve(caller: socket.socket) -> None:
    """Runs a program in a process of its own; ends it where the caller has ended."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    _, files, _, _ = socket.recv_fds(caller, 1, 3)
    wanted = json.loads(caller.makefile().readline())
    program = os.fork()
    if program == 0:
        caller.close()
        _run(wanted["arguments"], wanted["environment"], wanted["folder"], files)
        return
    while True:
        ended, status = os.waitpid(program, os.WNOHANG)
        if ended:
            caller.sendall(f"{os.waitstatus_to_exitcode(status)}\n".encode())
            os._exit(0)
        if select.select([caller], [], [], 0.02)[0]:  # readable once it is closed
            os.kill(program, signal.SIGKILL)
            os._exit(0)


def _run(arguments: list[str], environment: dict[str, str], folder: str, files: list[int]) -> None:
    """What Python does with such arguments."""
    for target, file in enumerate(files):
        os.dup2(file, target)
        os.close(file)
    # Those that the importer had remember whether its own could seek.
    sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", 1, encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    kind, *rest = arguments
    if kind in ("-c", "-m"):
        text, *rest = rest
        sys.argv = [kind, *rest]
        sys.path[0] = ""
        if kind == "-m":
            runpy.run_module(text, run_name="__main__", alter_sys=True)
            return
        sys.modules["__main__"] = main = ModuleType("__main__")
        exec(compile(text, "<string>", "exec"), main.__dict__)
        return
    sys.argv = arguments
    sys.path[0] = str(Path(kind).parent)
    runpy.run_path(kind, run_name="__main__")


if __name__ == "__main__":
    what, where, *more = sys.argv[1:]
    if what == "call":
        sys.exit(call(where, more))
    try:
        listen(where, int(more[0]))
    except Exception:
        traceback.print_exc()
        sys.exit(1)
