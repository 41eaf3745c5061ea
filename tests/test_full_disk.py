"""A full disk: one line with the path, exit status 1, and nothing left, in every command that writes.

A limit on the size of a file stands in for the full disk: no right to mount anything is needed, and the system answers
in the same place, with EFBIG for ENOSPC.
"""

import errno
import os
import shutil
from pathlib import Path

import pytest
from full_disk import full_disk

from copolicy.cards.cli import main as cards
from copolicy.collect.cli import main as collect
from copolicy.convert.cli import main as convert
from copolicy.dataset.cli import main as dataset
from copolicy.dataset.command_line.commands import system_line
from copolicy.dataset.files.staging import new_file, new_folder, replacements
from copolicy.train.cli import main as train


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> Path:
    """Recordings and two data sets."""
    folder = tmp_path_factory.mktemp("made")
    for seed, name in ((0, "one"), (1, "two")):
        arguments = ["simulate", "--episodes", "1", "--seed", str(seed), "--maps", "training", "--workers", "1"]
        assert collect([*arguments, "--out", str(folder / f"{name}-recordings")]) == 0
        flags = ["--out", str(folder / name), "--repo-id", "lab/table", "--license", "cc0-1.0"]
        assert convert(["mcap", str(folder / f"{name}-recordings"), *flags]) == 0
    return folder


def _files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


NEW = {  # commands that write a new file or folder, and the limit of a file's bytes
    "simulate": (collect, ["simulate", "--episodes", "2", "--maps", "training", "--workers", "1", "--out"], 20_000),
    "png": (collect, ["replay", "{recording}", "--out"], 2_000),
    "gif": (collect, ["replay", "{recording}", "--out"], 2_000),
    "mcap": (convert, ["mcap", "{made}/one-recordings", "--repo-id", "a/b", "--out"], 10_000),
    "shards": (
        convert,
        ["mcap", "{made}/one-recordings", "--shard-episodes", "1", "--repo-id", "a/b", "--out"],
        9_000,
    ),
    "merge": (convert, ["merge", "{made}/one", "{made}/two", "--same-people", "--repo-id", "a/b", "--out"], 9_000),
    "zarr": (convert, ["export", "{made}/one", "--format", "zarr", "--out"], 1_000),
    "robomimic": (convert, ["export", "{made}/one", "--format", "robomimic", "--out"], 9_000),
    "minari": (convert, ["export", "{made}/one", "--format", "minari", "--out"], 9_000),
    "policy": (train, ["export", "pretrained", "--out"], 100_000),
    "report": (cards, ["report", "{made}/one", "--out"], 9_000),
    "statistics": (dataset, ["stats", "{made}/one", "--out"], 500),
}
NAMES = {"png": "x.png", "gif": "x.gif", "minari": "x-v0", "robomimic": "x.hdf5", "report": "x.html"}


@pytest.mark.parametrize("name", NEW)
def test_a_new_file_is_not_written(name, folders, tmp_path, capsys):
    command, arguments, limit = NEW[name]
    (recording,) = (folders / "one-recordings").glob("*.mcap")
    filled = [argument.format(made=folders, recording=recording) for argument in arguments]
    out = tmp_path / NAMES.get(name, "out")
    capsys.readouterr()
    with full_disk(limit):
        status = command([*filled, str(out)])
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("copolicy-")]
    assert status == 1
    assert len(lines) == 1
    assert str(out) in lines[0] or ".out.shards" in lines[0]
    assert lines[0].endswith(f": {os.strerror(errno.EFBIG)}")
    # Finished shards are kept for the next call.
    assert [path.name for path in tmp_path.iterdir() if path.name != ".out.shards"] == []


CHANGED = {  # commands that change a data set
    "stats": (dataset, ["stats", "{set}"], 500),
    "exclude": (dataset, ["exclude", "{set}", "--episode-ids", "0", "--reason", "why"], 5_000),
    "release": (dataset, ["release", "{set}", "--bump", "minor", "--notes", "first"], 500),
    "card": (cards, ["dataset", "{set}", "--overwrite", "--no-figures"], 500),
    "figures": (cards, ["dataset", "{set}", "--overwrite"], 9_000),
    "append": (convert, ["mcap", "{made}/two-recordings", "--append", "--out", "{set}", "--repo-id", "a/b"], 9_000),
}


@pytest.mark.parametrize("name", CHANGED)
def test_a_data_set_stays_as_it_was(name, folders, tmp_path, capsys):
    command, arguments, limit = CHANGED[name]
    root = Path(shutil.copytree(folders / "one", tmp_path / "set"))
    before = _files(tmp_path)
    with full_disk(limit):
        status = command([argument.format(set=root, made=folders) for argument in arguments])
    error = capsys.readouterr().err
    lines = [line for line in error.splitlines() if line.startswith("copolicy-")]
    assert (status, len(lines)) == (1, 1)
    assert lines[0].split(": ")[1].startswith(str(root))
    assert lines[0].endswith(f": {os.strerror(errno.EFBIG)}")
    assert _files(tmp_path) == before


def test_a_check_without_space_for_its_findings_succeeds(folders, tmp_path, capsys):
    root = Path(shutil.copytree(folders / "one", tmp_path / "set"))
    before = _files(tmp_path)
    with full_disk(500):
        assert dataset(["check", str(root)]) == 0
    assert _files(tmp_path) == before


def test_a_training_that_comes_to_no_checkpoint_leaves_none(folders, tmp_path, capfd):
    flags = ["--policy.preset=small", "--policy.device=cpu", "--steps=1", "--batch_size=2", "--env_eval_freq=0"]
    with full_disk(100_000):
        status = train([f"--dataset.root={folders / 'one'}", f"--output_dir={tmp_path / 'run'}", *flags])
    lines = [line for line in capfd.readouterr().err.splitlines() if line.startswith("copolicy-")]
    assert status == 1
    assert len(lines) == 1
    assert lines[0].startswith(f"copolicy-train: {tmp_path / 'run'}")
    assert lines[0].endswith(os.strerror(errno.EFBIG))
    assert list(tmp_path.iterdir()) == []


def _replace(names: list[Path]) -> None:
    with replacements(names) as new:
        new[0].write_text("new", encoding="utf-8")
        new[1].write_bytes(bytes(200))


def _build(path: Path) -> None:
    with new_folder(path) as partial:
        partial.mkdir()
        (partial / "array").write_bytes(bytes(200))


def test_several_files_are_replaced_together_or_not_at_all(tmp_path):
    names = [tmp_path / "a", tmp_path / "b"]
    for name in names:
        name.write_text("old", encoding="utf-8")
    with full_disk(100), pytest.raises(OSError, match=os.strerror(errno.EFBIG)) as refused:
        _replace(names)
    assert refused.value.errno == errno.EFBIG
    assert {path.name: path.read_text(encoding="utf-8") for path in tmp_path.iterdir()} == {"a": "old", "b": "old"}


def test_the_error_names_the_final_path(tmp_path):
    with full_disk(100), pytest.raises(OSError, match=os.strerror(errno.EFBIG)) as refused:
        _build(tmp_path / "set")
    assert str(system_line(refused.value)).startswith(str(tmp_path / "set"))
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(FileNotFoundError) as missing, new_folder(tmp_path / "set") as partial:
        (partial / "deep" / "file").read_bytes()
    assert missing.value.filename == str(tmp_path / "set" / "deep" / "file")


def test_an_error_of_another_type_is_recognised_by_its_text(tmp_path):
    with pytest.raises(OSError, match="No space left") as refused, new_file(tmp_path / "weights"):
        raise ValueError("I/O error: No space left on device (os error 28)")
    assert system_line(refused.value) == f"{tmp_path / 'weights'}: No space left on device"
    assert system_line(ValueError("another")) is None
    assert system_line(OSError("Unable to write [Errno 28] No space left on device")) == "No space left on device"
    error = RuntimeError("the writer failed")
    error.__cause__ = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "a/b")
    assert system_line(error) == "a/b: No space left on device"
    assert system_line(KeyError("x")) is None
    error = KeyError("x")
    error.__context__ = FileNotFoundError(errno.ENOENT, "No such file", "a")
    assert system_line(error) is None  # a mistake of ours, not of the disk
