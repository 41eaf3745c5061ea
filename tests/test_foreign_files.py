"""Foreign and damaged files give one line and exit status 1 or 2 in every command.

Samples of tests/benchmarks/foreign_sweep.py.
"""

import os
from pathlib import Path

import pytest
from benchmarks import foreign_sweep
from foreign_files import FOREIGN
from own_permissions import permissions_apply
from reading_commands import COMMANDS, call

from copolicy.collect.inputs.calibration_store import CalibrationStore
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.file_kinds import describe_path

KINDS = {
    "nothing": "no such file or folder",
    "empty file": "an empty file",
    "text": "a text file",
    "zeros": "a file of zeros",
    "magic alone": "an MCAP file",
    "hdf5": "an HDF5 file",
    "npz": "a NumPy archive (.npz)",
    "npy": "a NumPy array (.npy)",
    "pickle": "a pickle",
    "parquet": "a Parquet file",
    "json": "a JSON file",
    "zip": "a zip archive",
    "damaged zip": "a damaged zip archive",
    "zarr zip of another project": "a zipped Zarr store (copolicy-convert upstream reads the original program's)",
    "pipe": "a pipe, socket or device",
    "empty folder": "an empty folder",
    "folder of text": "a folder of other files",
    "recordings of another project": "a folder of recordings (copolicy-convert mcap reads it)",
    "folder of hdf5": "a folder of other files (.hdf5)",
    "lerobot of another task": "a LeRobot data set (copolicy-dataset check and copolicy-convert export read it)",
    "zarr v2 of another project": "a Zarr store (copolicy-convert upstream reads the original program's)",
    "zarr v3 of another project": "a Zarr store (copolicy-convert upstream reads the original program's)",
}


@pytest.mark.parametrize("kind", KINDS)
def test_describe_path(tmp_path, kind):
    assert describe_path(FOREIGN[kind](tmp_path)) == KINDS[kind]


OWN_READERS = ("collect replay", "collect recover", "convert mcap", "convert upstream", "dataset check")


@pytest.mark.parametrize("kind", FOREIGN)
def test_foreign_files_give_one_line_in_each_command(tmp_path, kind, monkeypatch):
    commands = {name: COMMANDS[name] for name in OWN_READERS}
    if kind in ("text", "lerobot of another task", "recordings of another project", "zarr v3 of another project"):
        commands = {name: build for name, build in COMMANDS.items() if name != "dataset stats"}
    monkeypatch.setattr(foreign_sweep, "COMMANDS", commands)
    for command, _, verdict, words in foreign_sweep.foreign(tmp_path, {kind: FOREIGN[kind]}):
        assert verdict in ("refused", "passed"), (command, words)
        if verdict == "refused" and command != "dataset check":
            assert "place" in words, (command, words)  # the path
            assert "expected" in words


def test_damaged_files_give_one_line_or_pass(tmp_path):
    verdicts = [verdict for *_, verdict, _ in foreign_sweep.mutated(tmp_path, 2, 5)]
    assert set(verdicts) <= {"refused", "passed"}
    assert verdicts.count("refused") > len(verdicts) / 3


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such permissions")
def test_unreadable_files_give_one_line(tmp_path):
    for name in ("a.mcap", "a.zarr.zip"):
        (tmp_path / name).write_bytes(b"PK")
        (tmp_path / name).chmod(0)
    with permissions_apply():
        with pytest.raises(PermissionError):
            (tmp_path / "a.mcap").read_bytes()
        for name in ("a.mcap", "a.zarr.zip"):
            for command in ("collect replay", "convert mcap", "convert upstream"):
                verdict, words = call(*COMMANDS[command](tmp_path / name, tmp_path))
                assert verdict == "refused", (command, name)
                assert "Permission denied" in words, (command, name)


def test_a_file_in_place_of_the_folder_of_calibrations(tmp_path):
    (tmp_path / "config").write_text("x", encoding="utf-8")
    with pytest.raises(FileFormatError, match=r"config: expected a folder of calibrations, found a text file"):
        CalibrationStore(tmp_path / "config")
    assert Path(tmp_path / "config").read_text(encoding="utf-8") == "x"
