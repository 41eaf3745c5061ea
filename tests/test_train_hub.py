"""LeRobot on data sets of the Hub: training by an id, with a choice of episodes and exclusions; what was published."""

import json
from pathlib import Path

import pytest
from hub_user import Done, HubUser
from local_hub import LocalHub, Repository
from training_table import flags, mark_discarded, write_table
from versioned_data_set import simulated_data_set

from copolicy.dataset.versions.content import read_content
from copolicy.dataset.versions.release import release


@pytest.fixture(scope="module")
def first_call(tmp_path_factory):
    """A user and the first command of the user's process, before which nothing imports LeRobot.

    The Hub has a data set at a tag, whose `main` has gone on: there its episodes 1 and 4 are excluded.
    """
    root = write_table(tmp_path_factory.mktemp("data") / "table")
    repository = Repository(private=False)
    for tag, discarded in (("data-1.0.0", (2,)), ("v3.0", (1, 4))):
        mark_discarded(root, discarded)
        files = {path.relative_to(root).as_posix(): path.read_bytes() for path in root.rglob("*") if path.is_file()}
        repository.tags[tag] = repository.commit(files, tag)
    with LocalHub() as hub:
        hub.repositories["dataset", "lab/table"] = repository
        with HubUser(hub, tmp_path_factory.mktemp("home")) as user:
            flags = ["--policy.type=act", "--policy.device=cpu", "--dataset.root=/nowhere/table"]
            yield user, user.run(*flags, module="copolicy.train.cli")


@pytest.fixture(scope="module")
def user(first_call):
    return first_call[0]


def test_lerobots_own_policies_are_known_in_a_new_process(first_call):
    _, done = first_call
    assert done.status == 2
    assert done.err.splitlines()[-1].endswith("expected the folder of a LeRobot v3 data set, found no such folder")


def _train(user: HubUser, output: Path, *arguments: str) -> Done:
    given = [flag for flag in flags(output, output, steps=1, save_freq=1) if not flag.startswith("--dataset.")]
    return user.run("--dataset.repo_id=lab/table", *given, *arguments, module="copolicy.train.cli")


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
def test_by_id_with_a_revision_a_choice_and_exclusions(user, tmp_path, arguments, left_out, used):
    done = _train(user, tmp_path / "run", *arguments)
    assert done.status == 0, done.err[-3000:]
    assert left_out in done.err
    config = tmp_path / "run" / "checkpoints" / "last" / "pretrained_model" / "train_config.json"
    trained = json.loads(config.read_text(encoding="utf-8"))["dataset"]
    assert (trained["repo_id"], trained["root"], trained["episodes"]) == ("lab/table", None, used)
    assert f"dataset.num_episodes={len(used)}" in done.err


def test_an_id_that_is_not_there_is_one_line(user, tmp_path):
    done = _train(user, tmp_path / "run", "--dataset.repo_id=lab/nothing")
    assert done.status == 1
    line = done.err.splitlines()[-1]
    assert line.startswith("copolicy-train: training stopped: RepositoryNotFoundError: ")
    assert "lab/nothing" in line


def test_lerobot_loads_the_published_content_by_its_tag(user, tmp_path):
    root = simulated_data_set(tmp_path / "table")
    release(root, "major", "The first.")
    done = user.run("publish", root, "--repo-id", "lab/released", "--raw", tmp_path / "recordings")
    assert done.status == 0, done.err
    loaded = user.run("lab/released", "data-1.0.0", "", module="loaded_from_hub")
    assert loaded.status == 0, loaded.err
    lines = [line for line in loaded.out.splitlines() if line.startswith("copolicy-content-1")]
    assert len(lines) == 2
    assert all(line.startswith(read_content(root).hash + " ") for line in lines)
    assert all(line.endswith("torch.Size([4])") for line in lines)
