"""The newest checkpoint of a run is found with and without links."""

import shutil
from pathlib import Path

import pytest

from copolicy.cards.checkpoint_facts import CheckpointFacts
from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.policies.training_run import find_policy_folder


def _checkpoint(folder: Path) -> Path:
    policy = folder / "pretrained_model"
    policy.mkdir(parents=True)
    (policy / "config.json").write_text('{"type": "copolicy"}', encoding="utf-8")
    (policy / "model.safetensors").write_bytes(folder.name.encode())
    return policy


@pytest.fixture
def run(tmp_path) -> Path:
    run = tmp_path / "run"
    # A run longer than its names are wide: as text, 999998 would come after 1000000.
    for name in ("999998", "1000000", "1000002"):
        _checkpoint(run / "checkpoints" / name)
    (run / "checkpoints" / "1000002" / "pretrained_model" / "model.safetensors").unlink()  # broke off while saving
    return run


def _no_link(last: Path) -> None:
    assert not last.exists()


@pytest.mark.parametrize(
    "make_last",
    [
        _no_link,
        lambda last: last.symlink_to("0000001"),
        lambda last: last.write_text("1000000", encoding="utf-8"),
        lambda last: last.mkdir(),
        lambda last: shutil.copytree(last.parent / "999998", last),
    ],
    ids=["none", "broken link", "text file", "empty folder", "copy of an earlier checkpoint"],
)
def test_the_highest_number_is_used_in_a_run_copied_without_links(run, make_last):
    last = run / "checkpoints" / "last"
    make_last(last)
    expected = run / "checkpoints" / "1000000" / "pretrained_model"
    for path in (run, run / "checkpoints", last, last / "pretrained_model"):
        assert checkpoint_folder(path) == expected
        assert CheckpointFacts.read(path).folder == expected


def test_links_and_checkpoint_paths_are_followed(run):
    (run / "checkpoints" / "last").symlink_to("999998")
    for path in (run, run / "checkpoints", run / "checkpoints" / "last", run / "checkpoints" / "999998"):
        assert (checkpoint_folder(path) / "model.safetensors").read_bytes() == b"999998"


def test_a_copied_last_alone_is_a_checkpoint(tmp_path):
    expected = _checkpoint(tmp_path / "checkpoints" / "last")
    assert checkpoint_folder(tmp_path) == expected
    assert checkpoint_folder(tmp_path / "checkpoints" / "last") == expected


def test_the_required_files_can_be_given(run):
    assert find_policy_folder(run, ("train_config.json",)) is None
    (run / "checkpoints" / "999998" / "pretrained_model" / "train_config.json").touch()
    assert find_policy_folder(run, ("train_config.json",)) == run / "checkpoints" / "999998" / "pretrained_model"


def test_a_run_without_checkpoints_gives_none(tmp_path):
    (tmp_path / "checkpoints").mkdir()
    with pytest.raises(FileFormatError, match=r"expected a checkpoint folder with config.json and model.safetensors"):
        checkpoint_folder(tmp_path)
