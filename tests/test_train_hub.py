"""`copolicy-train` on a data set that it gets from the Hub by its id, with a choice of episodes and exclusions."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from local_hub import LocalHub, Repository
from training_table import flags, mark_discarded, write_table

_SCRIPT = "import sys; from copolicy.train.cli import main; sys.exit(main())"


@pytest.fixture(scope="module")
def hub(tmp_path_factory):
    """A Hub with a data set at a tag, whose `main` has gone on: there its episodes 1 and 4 are excluded."""
    root = write_table(tmp_path_factory.mktemp("data") / "table")
    repository = Repository(private=False)
    for tag, discarded in (("data-1.0.0", (2,)), ("v3.0", (1, 4))):
        mark_discarded(root, discarded)
        files = {path.relative_to(root).as_posix(): path.read_bytes() for path in root.rglob("*") if path.is_file()}
        repository.tags[tag] = repository.commit(files, tag)
    with LocalHub() as hub:
        hub.repositories["dataset", "lab/table"] = repository
        yield hub


def _train(hub: LocalHub, home: Path, *arguments: str) -> tuple[subprocess.CompletedProcess, Path]:
    output = home / "run"
    environment = {name: value for name, value in os.environ.items() if not name.startswith("HF_")}
    given = [flag for flag in flags(home, output, steps=1, save_freq=1) if not flag.startswith("--dataset.")]
    done = subprocess.run(
        [sys.executable, "-c", _SCRIPT, "--dataset.repo_id=lab/table", *given, *arguments],
        env={**environment, **hub.environment(home)},
        capture_output=True,
        text=True,
        timeout=400,
    )
    return done, output / "checkpoints" / "last" / "pretrained_model" / "train_config.json"


@pytest.mark.parametrize(
    ("arguments", "left_out", "used"),
    [
        ((), "Leaving out 2 discarded of 6 episodes: [1, 4]", [0, 2, 3, 5]),
        (
            ("--dataset.revision=data-1.0.0", "--dataset.episodes=[5,2,1]"),
            "Leaving out 1 discarded of 3 episodes: [2]",
            [5, 1],
        ),
    ],
)
def test_by_id_with_a_revision_a_choice_and_exclusions(hub, tmp_path, arguments, left_out, used):
    done, config = _train(hub, tmp_path, *arguments)
    assert done.returncode == 0, done.stderr[-3000:]
    assert left_out in done.stderr
    trained = json.loads(config.read_text(encoding="utf-8"))["dataset"]
    assert (trained["repo_id"], trained["root"], trained["episodes"]) == ("lab/table", None, used)
    assert f"dataset.num_episodes={len(used)}" in done.stderr


def test_an_id_that_is_not_there_is_one_line(hub, tmp_path):
    done, _ = _train(hub, tmp_path, "--dataset.repo_id=lab/nothing")
    assert done.returncode == 1
    line = done.stderr.splitlines()[-1]
    assert line.startswith("copolicy-train: training stopped: RepositoryNotFoundError: ")
    assert "lab/nothing" in line
