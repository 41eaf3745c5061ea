"""Every command ignores the side files of macOS (`._NAME`, `.DS_Store`)."""

import contextlib
import io
import json
import shutil
from pathlib import Path

import pytest
from checked_data import contents, make_data_set, make_recordings
from training_table import flags

from copolicy.cards.cli import main as cards
from copolicy.collect.cli import main as collect
from copolicy.collect.session import iter_recordings
from copolicy.collect.simulate.command import simulate
from copolicy.convert.cli import main as convert
from copolicy.convert.upstream.conversion import open_upstream
from copolicy.dataset.checks.checking import check_dataset
from copolicy.dataset.cli import main as dataset
from copolicy.dataset.transfer.raw_recordings import find_raw_recordings
from copolicy.dataset.versions.manifest import Manifest
from copolicy.train.cli import main as train


def litter(folder: Path) -> Path:
    """Adds side files to a folder and its sub-folders, as after a copy to another disk and back."""
    for inside in [folder, *(path for path in folder.rglob("*") if path.is_dir())]:
        for name in (".DS_Store", "Thumbs.db", *(f"._{path.name}" for path in list(inside.iterdir()))):
            (inside / name).write_bytes(b"\x00\x05\x16\x07\x00\x02\x00\x00Mac OS X")
    return folder


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """Recordings `raw`, the set of them `set`, and both with side files everywhere, as `littered/raw` and so on."""
    folder = tmp_path_factory.mktemp("hidden")
    make_data_set(make_recordings(folder / "raw", 4), folder / "set", "--video", "--video-size", "160x80")
    for name in ("raw", "set"):
        litter(Path(shutil.copytree(folder / name, folder / "littered" / name)))
    return folder


@pytest.fixture
def root(made, tmp_path) -> Path:
    """The littered data set, to change."""
    return Path(shutil.copytree(made / "littered" / "set", tmp_path / "set"))


def ok(main, *arguments: object) -> dict:
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        assert main([*map(str, arguments), "--json"]) == 0
    return json.loads(output.getvalue())


def test_recordings_are_converted_checked_and_found(made, tmp_path):
    raw = made / "littered" / "raw"
    video = ("--video", "--video-size", "160x80", "--license", "cc-by-4.0")
    ok(convert, "mcap", raw, "--out", tmp_path / "set", "--repo-id", "lab/table", *video)
    assert contents(tmp_path / "set").keys() == contents(made / "set").keys()
    assert check_dataset(raw).findings == check_dataset(made / "raw").findings
    assert len(find_raw_recordings(made / "set", raw).files) == len(list(iter_recordings(raw))) == 4
    assert ok(collect, "recover", raw)["damaged"] == 0


def test_a_data_set_is_checked_described_and_released(made, root):
    assert check_dataset(root).findings == check_dataset(made / "set").findings
    assert Manifest.from_folder(root).files == Manifest.from_folder(made / "set").files
    ok(dataset, "exclude", root, "--episode-ids", 1, "--reason", "stick unplugged")
    ok(dataset, "stats", root)
    ok(dataset, "release", root, "--bump", "minor", "--notes", "The first.")
    litter(root)
    assert ok(dataset, "check", root)["counts"]["error"] == 0
    assert ok(dataset, "diff", f"{root}@0.1.0", root)["same"]
    ok(cards, "dataset", root, "--repo-id", "lab/table", "--croissant")
    ok(cards, "report", root, "--out", root.parent / "page.html")
    croissant = (root / "meta" / "croissant.json").read_text(encoding="utf-8")
    assert "/._" not in croissant


@pytest.mark.parametrize(("format", "name"), [("zarr", "a.zarr"), ("robomimic", "a.hdf5"), ("minari", "a-v0")])
def test_a_data_set_is_exported(root, tmp_path, format, name):
    assert ok(convert, "export", root, "--format", format, "--out", tmp_path / name)["episodes"] == 4


def test_data_sets_are_added_to_and_merged(made, root, tmp_path):
    make_recordings(tmp_path / "new", 2, seed=7)
    added = ok(convert, "mcap", tmp_path / "new", "--out", root, "--repo-id", "lab/table", "--append")
    assert added["episodes"] == 6
    ok(
        convert,
        "mcap",
        tmp_path / "new",
        "--out",
        tmp_path / "b",
        "--repo-id",
        "lab/b",
        "--video",
        "--video-size",
        "160x80",
    )
    litter(tmp_path / "b")
    merged = ok(convert, "merge", made / "littered/set", tmp_path / "b", "--out", tmp_path / "c", "--repo-id", "lab/c")
    assert merged["episodes"] == 6
    assert not any("._" in name or "Thumbs" in name for name in contents(tmp_path / "c"))


def test_a_data_set_is_trained_on(random_table, tmp_path):
    root = litter(Path(shutil.copytree(random_table, tmp_path / "table")))
    with contextlib.redirect_stdout(io.StringIO()):
        assert train(flags(root, tmp_path / "run")) == 0
    assert (tmp_path / "run/checkpoints/last/pretrained_model/model.safetensors").is_file()


def test_the_originals_files_are_imported(examples, tmp_path):
    for name in ("raw", "processed_npz", "table_10Hz.zarr"):
        folder = litter(Path(shutil.copytree(examples / name, tmp_path / name)))
        summary = ok(convert, "upstream", folder, "--out", tmp_path / f"{name}-set", "--repo-id", "lab/table")
        assert summary["episodes"] == len(open_upstream(examples / name).readers)
        assert summary["damaged_left_out"] == []


def test_a_folder_with_side_files_alone_counts_as_empty(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "._episode_000000.mcap").write_bytes(b"Mac OS X")
    assert simulate(tmp_path / "out", 1, seed=0, workers=1)["episodes"] == 1
