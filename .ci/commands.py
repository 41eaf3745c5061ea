"""Runs the commands of documents, each document in an empty folder of its own: `commands.py FOLDER DOCUMENT...`.

Every line of a ```bash block is a command. What a document says about its own blocks stands in a comment before them:

* `<!-- not run: REASON -->`: the next block needs people, a network or hours; it is skipped with a line of output.
* `<!-- file: NAME -->`: the next block is the content of a file that the commands after it read.
* `<!-- findings -->`: exit status 1 (the command has findings) is no failure in the next block.
* `<!-- hub -->`: the next block talks to the Hub; here, to a small Hub on this machine (`tests/local_hub.py`).

`play` runs one episode with scripted agents in the place of people, without a window; its other flags stay.
"""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
_BLOCK = re.compile(r"^(?:<!-- ([a-z ]+)(?:: ([^\n]*))? -->\n)?```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_ELSEWHERE = ("copolicy-quickstart", "pytest")
"""Commands that the continuous integration and `tests/test_quickstart.py` run."""


@dataclass(frozen=True)
class Block:
    """A block of a document: its language, its text, and what the comment before it says."""

    language: str
    text: str
    kind: str = ""
    detail: str = ""


def blocks(text: str) -> Iterator[Block]:
    """The blocks of a document in Markdown, in order."""
    for kind, detail, language, content in _BLOCK.findall(text):
        yield Block(language, content, kind, detail)


def commands(block: Block) -> Iterator[str]:
    """The commands of a block as they can be run here."""
    lines = (line.split("  #")[0].rstrip() for line in block.text.replace("\\\n", " ").splitlines())
    for line in filter(None, lines):
        line = line.removeprefix("uv run ")  # the caller's PATH has the commands
        if line.startswith("copolicy-collect play "):
            line = re.sub(r"\b(keyboard|joystick)\b", "scripted", line) + " --headless --episodes 1"
            line += "" if "--players" in line else " --players scripted scripted"
        if not line.startswith(_ELSEWHERE):
            yield line


def run(document: Path, folder: Path, hub: dict[str, str]) -> int:
    """Runs the commands of a document in a folder; their number.

    Args:
        hub: environment of the commands that talk to the Hub; the others have none.

    Raises:
        SystemExit: a command failed.
    """
    offline = {**os.environ, "HF_HUB_OFFLINE": "1"}
    count = 0
    for block in blocks(document.read_text(encoding="utf-8")):
        if block.kind == "file":
            (folder / block.detail).write_text(block.text, encoding="utf-8")
        elif block.language == "bash" and block.kind == "not run":
            print(f"{document}: not run ({block.detail}): {' ; '.join(block.text.splitlines())}", flush=True)
        elif block.language == "bash":
            for command in commands(block):
                print(f"{document}$ {command}", flush=True)
                environment = {**os.environ, **hub} if block.kind == "hub" else offline
                done = subprocess.run(
                    ["bash", "-c", command], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                    stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                )  # fmt: skip
                if done.returncode not in ((0, 1) if block.kind == "findings" else (0,)):
                    sys.exit(f"{done.stdout[-4000:]}\n{document}: exit status {done.returncode}: {command}")
                count += 1
    return count


def main(folder: Path, documents: list[Path]) -> None:
    """Runs documents, as many at once as there are cores; the first failure ends the run."""
    sys.path.append(str(ROOT / "tests"))
    from local_hub import LocalHub

    def run_alone(document: Path) -> None:
        workplace = folder / document.as_posix().replace("/", "-")
        workplace.mkdir(parents=True)
        with LocalHub() as hub:
            count = run(document, workplace, hub.environment(workplace / "home"))
        print(f"{document}: {count} commands ran", flush=True)

    with ThreadPoolExecutor(os.cpu_count()) as workers:
        started = [workers.submit(run_alone, document) for document in documents]
        try:
            for future in as_completed(started):
                future.result()
        except BaseException:
            workers.shutdown(wait=False, cancel_futures=True)
            raise


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(path) for path in sys.argv[2:]])
