"""The commands of the quickstart, run one after the other: a line each, a log, and a second try that goes on."""

import contextlib
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
        purpose: what it is for.
        makes: files and folders that it writes; they go before it is tried again.
    """

    purpose: str
    command: tuple[str, ...]
    makes: tuple[Path, ...]
    environment: tuple[tuple[str, str], ...] = ()

    @property
    def typed(self) -> str:
        """The command as one would type it."""
        return " ".join([f"{name}={value}" for name, value in self.environment] + [shlex.join(self.command)])


def run_chain(out: Path, steps: Sequence[Step]) -> None:
    """Runs the steps in a new folder, or goes on in one where an earlier try stopped.

    Steps that a try with the same commands finished are not repeated; what the others left goes first. Everything that
    the commands say goes into `LOG_FILE` in the folder, a line a step to stderr.

    Raises:
        OutputExistsError: the folder holds something else than an unfinished try.
        RunError: a command failed, or another quickstart works in the folder.
    """
    record = out / _RECORD
    if os.path.lexists(out) and not record.is_file() and not _is_empty(out):
        raise OutputExistsError(out)
    out.mkdir(parents=True, exist_ok=True)
    refusal = f"{out}: expected a folder that nobody works in, found another quickstart at work"
    with FolderLock(out / _LOCK, refusal), (out / LOG_FILE).open("a", encoding="utf-8") as log:
        finished = _common(_finished(record), [step.typed for step in steps])
        replace_text(record, json.dumps(finished) + "\n")
        _say(f"Everything that the commands say is in {out / LOG_FILE}\n")
        for place, step in enumerate(steps):
            line = f"[{place + 1}/{len(steps)}] {step.purpose}"
            if place < len(finished):
                _say(f"{line}: done before\n")
                continue
            for path in step.makes:
                _remove(path)
            _execute(step, line, log)
            finished.append(step.typed)
            replace_text(record, json.dumps(finished) + "\n")


def forget_chain(out: Path) -> None:
    """Makes a finished folder one like any other: nothing is to be gone on with there."""
    (out / _RECORD).unlink(missing_ok=True)
    with contextlib.suppress(OSError):  # Windows keeps what another process looks at
        (out / _LOCK).unlink(missing_ok=True)


def _is_empty(folder: Path) -> bool:
    # A first try that ended before its first command has left its log.
    return folder.is_dir() and all(is_hidden(entry.name) or entry.name == LOG_FILE for entry in folder.iterdir())


def _finished(record: Path) -> list[str]:
    if not record.is_file():
        return []
    try:
        finished = json.loads(record.read_text(encoding="utf-8"))
    except ValueError:
        finished = None
    if not isinstance(finished, list):
        raise FileFormatError(record, "the commands that an earlier quickstart finished", "something else")
    return finished


def _common(finished: Sequence[str], typed: Sequence[str]) -> list[str]:
    """The commands at the beginning of both."""
    same = []
    for one, other in zip(finished, typed, strict=False):
        if one != other:
            break
        same.append(one)
    return same


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
    # Nothing of the chain needs the network; saying so keeps LeRobot from asking the Hub about a local folder.
    environment = {**os.environ, "HF_HUB_OFFLINE": "1", **dict(step.environment)}
    log.write(f"\n$ {step.typed}\n")
    log.flush()
    began = Path(log.name).stat().st_size
    with subprocess.Popen([program, *flags], env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log) as run:
        try:
            status = _waited(run, line)
        except BaseException:
            # Ctrl-C reached it too; a moment to leave nothing half done.
            with contextlib.suppress(subprocess.TimeoutExpired):
                run.wait(5)
            run.kill()
            raise
    if status:
        said = Path(log.name).read_bytes()[began:].decode("utf-8", errors="replace").splitlines()
        _say("".join(f"    {one}\n" for one in said[-_LAST_LINES:]))
        raise RunError(
            f"this command ended with status {status}: {shlex.join(step.command)}; what it said is in {log.name}; the "
            "same call again goes on from there"
        )


def _waited(run: subprocess.Popen, line: str) -> int:
    """Waits for a command beside its line, which shows the seconds as they pass where somebody looks on."""
    shown = sys.stderr.isatty()
    started = perf_counter()
    _say(line)
    try:
        while True:
            try:
                return run.wait(1 if shown else None)
            except subprocess.TimeoutExpired:
                _say(f"\r{line}: {perf_counter() - started:.0f} s")
    finally:
        _say(("\r" + line if shown else "") + f": {perf_counter() - started:.0f} s\n")


def _say(text: str) -> None:
    print(text, end="", file=sys.stderr, flush=True)
