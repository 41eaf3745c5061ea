"""Somebody who runs our commands against a local hub: one subprocess with the real client, many commands.

The client reads `HF_ENDPOINT` when it is imported, which must not happen in the process of the tests; importing it
for each command anew would take most of the time.
"""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from local_hub import TOKEN, LocalHub

_WORKER = """
import contextlib, importlib, io, json, os, sys, time
time.sleep = lambda seconds: None  # the client waits up to 8 s before it tries again
replies, sys.stdout = sys.stdout, sys.stderr
sys.path.append(sys.argv[1])
for line in sys.stdin:
    request = json.loads(line)
    os.environ.pop("HF_TOKEN", None)
    if request["token"]:
        os.environ["HF_TOKEN"] = request["token"]
    main = importlib.import_module(request["module"]).main
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = main(request["arguments"])
        except SystemExit as stop:
            status = stop.code
    print(json.dumps([status, out.getvalue(), err.getvalue()]), file=replies, flush=True)
"""


@dataclass(frozen=True)
class Done:
    """What a command left behind."""

    status: int
    out: str
    err: str

    @property
    def error(self) -> str:
        """Why the command did not do its work: its one line on stderr."""
        assert (self.status, self.out) == (1, "")
        assert self.err.count("\n") == 1
        return self.err.strip().removeprefix("copolicy-dataset: ")


class HubUser:
    """Runs commands one after the other, until the end of a `with` block."""

    def __init__(self, hub: LocalHub, home: Path):
        self.hub, self.home = hub, home

    def __enter__(self) -> "HubUser":
        environment = {name: value for name, value in os.environ.items() if not name.startswith("HF_")}
        self._stderr = (self.home / "stderr.txt").open("w+", encoding="utf-8")
        self._worker = subprocess.Popen(
            [sys.executable, "-c", _WORKER, str(Path(__file__).parent)],
            env={**environment, **self.hub.environment(self.home, token=None)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._stderr,
            text=True,
        )
        return self

    def __exit__(self, *_) -> None:
        self._worker.communicate()
        self._stderr.close()

    def run(self, *arguments: object, token: str | None = TOKEN, module: str = "copolicy.dataset.cli") -> Done:
        """Runs `copolicy-dataset`, or the command of another module; whatever it prints, it never prints the token."""
        assert self._worker.stdin is not None
        assert self._worker.stdout is not None
        request = {"module": module, "arguments": list(map(str, arguments)), "token": token}
        print(json.dumps(request), file=self._worker.stdin, flush=True)
        done = Done(*json.loads(self._worker.stdout.readline()))
        assert token is None or token not in done.out + done.err + (self.home / "stderr.txt").read_text(
            encoding="utf-8"
        )
        return done
