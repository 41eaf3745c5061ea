"""A converted folder loads by name with its minimal card, a card replaces it, and unknown numbers are null."""

import json
import shutil
from pathlib import Path

import datasets
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml

from copolicy.cards.cli import main as cards
from copolicy.collect.cli import main as collect
from copolicy.convert.cli import main as convert
from copolicy.dataset.cli import main as dataset
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.publication.minimal_card import CONFIGS, is_minimal_card
from copolicy.dataset.transfer.publish import verify_release
from copolicy.dataset.versions.content import read_content

EPISODES = Path("meta/episodes/chunk-000/file-000.parquet")


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("made")
    for seed, name, licence in ((0, "one", "cc0-1.0"), (1, "two", "mit")):
        arguments = ["simulate", "--episodes", "2", "--seed", str(seed), "--maps", "training", "--workers", "1"]
        assert collect([*arguments, "--out", str(folder / f"{name}-recordings")]) == 0
        assert _convert(folder, name, folder / name, "--license", licence) == 0
    return folder


def _convert(made: Path, name: str, root: Path, *flags: str) -> int:
    return convert(["mcap", str(made / f"{name}-recordings"), "--out", str(root), "--repo-id", "lab/table", *flags])


def _metadata(root: Path) -> dict:
    return yaml.safe_load((root / "README.md").read_text(encoding="utf-8").split("---")[1])


def _loads(root: Path, cache: Path, episodes: int) -> None:
    info = json.loads((root / "meta/info.json").read_text(encoding="utf-8"))
    counts = {"default": info["total_frames"], "episodes": episodes}
    for name, _ in CONFIGS:
        loaded = datasets.load_dataset(str(root), name, split="train", cache_dir=str(cache))
        assert len(loaded) == counts[name]
        assert {"default": "observation.state", "episodes": "pair_id"}[name] in loaded.column_names


@pytest.mark.parametrize("how", ["converted", "sharded", "appended", "merged", "card"])
def test_both_configurations_load_by_name(how, made, tmp_path, monkeypatch):
    monkeypatch.setattr("datasets.config.HF_DATASETS_OFFLINE", True)
    root, episodes, licence = tmp_path / "set", 2, "cc0-1.0"
    if how == "converted":
        root = made / "one"
    elif how == "sharded":
        assert _convert(made, "one", root, "--license", licence, "--shard-episodes", "1") == 0
    elif how == "appended":
        shutil.copytree(made / "one", root)
        assert _convert(made, "two", root, "--append", "--license", "mit") == 0
        episodes, licence = 4, None
    elif how == "merged":
        flags = ["--same-people", "--out", str(root), "--repo-id", "lab/both"]
        assert convert(["merge", str(made / "one"), str(made / "two"), *flags]) == 0
        episodes, licence = 4, None
    else:
        shutil.copytree(made / "one", root)
        assert cards(["dataset", str(root), "--no-figures"]) == 0  # no --overwrite
    assert is_minimal_card(root / "README.md") == (how != "card")
    assert _metadata(root).get("license") == licence
    assert _metadata(root)["configs"] == [{"config_name": name, "data_files": files} for name, files in CONFIGS]
    _loads(root, tmp_path / "cache", episodes)


def test_a_written_readme_is_kept(made, tmp_path, capsys):
    root = Path(shutil.copytree(made / "one", tmp_path / "set"))
    (root / "README.md").write_text("written by hand", encoding="utf-8")
    assert cards(["dataset", str(root), "--no-figures"]) == 2
    assert "nothing was overwritten" in capsys.readouterr().err
    assert _convert(made, "two", root, "--append") == 0
    assert (root / "README.md").read_text(encoding="utf-8") == "written by hand"


def test_a_minimal_card_cannot_be_published(made, tmp_path):
    root = Path(shutil.copytree(made / "one", tmp_path / "set"))
    assert dataset(["release", str(root), "--bump", "minor", "--notes", "first"]) == 0
    with pytest.raises(FileFormatError, match="found the minimal one of copolicy-convert"):
        verify_release(root)
    assert cards(["dataset", str(root), "--no-figures"]) == 0
    verify_release(root)


def test_an_unknown_number_is_null(made):
    table = pq.ParquetFile(made / "one" / EPISODES).read()
    assert table.column("achieved_hz").to_pylist() == [None, None]
    assert table.schema.field("achieved_hz").type == pa.float64()
    assert table.column("replay_drift_px").null_count == 0


def test_nan_of_an_earlier_version_gives_the_same_content_hash(made, tmp_path):
    earlier = Path(shutil.copytree(made / "one", tmp_path / "earlier"))
    table = pq.ParquetFile(earlier / EPISODES).read()
    place = table.column_names.index("achieved_hz")
    table = table.set_column(place, "achieved_hz", pa.array([float("nan")] * 2))
    assert table.column("achieved_hz").null_count == 0
    pq.write_table(table, earlier / EPISODES)
    assert read_content(earlier).hash == read_content(made / "one").hash
    flags = ["--same-people", "--out", str(tmp_path / "merged"), "--repo-id", "lab/both"]
    assert convert(["merge", str(earlier), str(made / "two"), *flags]) == 0
    merged = pq.ParquetFile(tmp_path / "merged" / EPISODES).read()
    assert merged.column("achieved_hz").to_pylist() == [None] * 4
