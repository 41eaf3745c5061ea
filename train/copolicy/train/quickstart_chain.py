"""Runs the commands of the quickstart in sequence, with a log; a second call continues after the last finished one."""

import contextlib
import itertools
import json
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import IO

from copolicy.dataset.exceptions import FileFormatError, OutputExistsError, RunError
from copolicy.dataset.files.listing import is_hidden
from copolicy.dataset.files.lock import FolderLock
from copolicy.dataset.files.staging import replace_text

LOG_FILE = "quickstart.log"
_RECORD, _LOCK = ".quickstart.json", ".quickstart.lock"
_LAST_LINES = 10


@dataclass(frozen=True)
class Step:
    """One command of the chain.

    Attributes:
        purpose: one line for the terminal.
        outputs: files and folders that it writes; they are removed before it runs.
    """

    purpose: str
    command: tuple[str, ...]
    outputs: tuple[Path, ...]
    environment: tuple[tuple[str, str], ...] = ()

    @property
    def command_line(self) -> str:
        """The command as typed in a shell."""
        return " ".join([f"{name}={value}" for name, value in self.environment] + [shlex.join(self.command)])


def run_chain(out: Path, steps: Sequence[Step]) -> None:
    """Runs the steps in a new folder, or continues in the folder of an interrupted run.

    Steps that an earlier run finished with the same commands are skipped; outputs of the others are removed first. The
    commands' output is written to `LOG_FILE` in the folder, one line per step to stderr.

    Raises:
        OutputExistsError: the folder has other content than an unfinished run.
        RunError: a command failed, or another quickstart runs in the folder.
    """
    record = out / _RECORD
    if os.path.lexists(out) and not record.is_file() and not _is_empty(out):
        raise OutputExistsError(out)
    out.mkdir(parents=True, exist_ok=True)
    refusal = f"{out}: expected a folder that is not in use, found another quickstart running in it"
    with FolderLock(out / _LOCK, refusal), (out / LOG_FILE).open("a", encoding="utf-8") as log:
        finished = _common_prefix(_finished_commands(record), [step.command_line for step in steps])
        replace_text(record, json.dumps(finished) + "\n")
        _print(f"The commands' output is in {out / LOG_FILE}\n")
        for index, step in enumerate(steps):
            line = f"[{index + 1}/{len(steps)}] {step.purpose}"
            if index < len(finished):
                _print(f"{line}: done before\n")
                continue
            for path in step.outputs:
                _remove(path)
            _execute(step, line, log)
            finished.append(step.command_line)
            replace_text(record, json.dumps(finished) + "\n")


def remove_record(out: Path) -> None:
    """Removes the record and lock of a finished run, so that the folder is not continued in."""
    (out / _RECORD).unlink(missing_ok=True)
    with contextlib.suppress(OSError):  # Windows cannot remove a file that another process has open
        (out / _LOCK).unlink(missing_ok=True)


def _is_empty(folder: Path) -> bool:
    # A run that was interrupted before its first command has only a log.
    return folder.is_dir() and all(is_hidden(entry.name) or entry.name == LOG_FILE for entry in folder.iterdir())


def _finished_commands(record: Path) -> list[str]:
    if not record.is_file():
        return []
    try:
        finished = json.loads(record.read_text(encoding="utf-8"))
    except ValueError:
        finished = None
    if not isinstance(finished, list):
        raise FileFormatError(record, "the commands that an earlier quickstart finished", "something else")
    return finished


def _common_prefix(finished: Sequence[str], commands: Sequence[str]) -> list[str]:
    pairs = zip(finished, commands, strict=False)
    return [command for command, _ in itertools.takewhile(lambda pair: pair[0] == pair[1], pairs)]


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _execute(step: Step, line: str, log: IO[str]) -> None:
    name, *flags = step.command
    program = shutil.which(name, path=sysconfig.get_path("scripts")) or shutil.which(name)
    if program is None:
        raise RunError(f"expected the program {name} beside this one, found none")
    # The chain needs no network; without this, LeRobot queries the Hub about a local folder.
    environment = {**os.environ, "HF_HUB_OFFLINE": "1", **dict(step.environment)}
    log.write(f"\n$ {step.command_line}\n")
    log.flush()
    log_start = Path(log.name).stat().st_size
    with subprocess.Popen([program, *flags], env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log) as run:
        try:
            status = _wait(run, line)
        except BaseException:
            # Ctrl-C also interrupts the command; give it time to clean up.
            with contextlib.suppress(subprocess.TimeoutExpired):
                run.wait(5)
            run.kill()
            raise
    if status:
        output = Path(log.name).read_bytes()[log_start:].decode("utf-8", errors="replace").splitlines()
        _print("".join(f"    {text}\n" for text in output[-_LAST_LINES:]))
        raise RunError(
            f"this command ended with status {status}: {shlex.join(step.command)}; its output is in {log.name}; the "
            "same call again continues from there"
        )


def _wait(run: subprocess.Popen, line: str) -> int:
    """Waits for a command; prints its line with the elapsed seconds, updated each second on a terminal."""
    is_terminal = sys.stderr.isatty()
    started = perf_counter()
    _print(line)
    try:
        while True:
            try:
                return run.wait(1 if is_terminal else None)
            except subprocess.TimeoutExpired:
                _print(f"\r{line}: {perf_counter() - started:.0f} s")
    finally:
        _print(("\r" + line if is_terminal else "") + f": {perf_counter() - started:.0f} s\n")


def _print(text: str) -> None:
    print(text, end="", file=sys.stderr, flush=True)
