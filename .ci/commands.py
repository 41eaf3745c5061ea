"""Runs the commands of documents, each document in an empty folder of its own: `commands.py FOLDER DOCUMENT...`.

Every line of a ```bash block is a command. What a document says about its own blocks stands in a comment before them:

* `<!-- not run: REASON -->`: the next block needs people, a network or hours; it is left out, and that is said.
* `<!-- file: NAME -->`: the next block is the content of a file that the commands after it read.
* `<!-- findings -->`: exit status 1, by which a command says that it found something, is no failure.
* `<!-- hub -->`: the next block talks to the Hub; here, to a small Hub on this machine (`tests/local_hub.py`).

Further flags of `play` are kept, but people are not to be had: simulated ones play one episode, without a window.
"""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
_BLOCK = re.compile(r"^(?:<!-- ([a-z ]+)(?:: (.*))? -->\n)?```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
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
            print(f"left out, {block.detail}: {' ; '.join(block.text.splitlines())}", flush=True)
        elif block.language == "bash":
            for command in commands(block):
                print(f"$ {command}", flush=True)
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
    """Runs documents one after the other."""
    sys.path.append(str(ROOT / "tests"))
    from local_hub import LocalHub

    for number, document in enumerate(documents):
        workplace = folder / str(number)
        workplace.mkdir(parents=True)
        with LocalHub() as hub:
            count = run(document, workplace, hub.environment(workplace / "home"))
        print(f"{document}: {count} commands ran", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(path) for path in sys.argv[2:]])
