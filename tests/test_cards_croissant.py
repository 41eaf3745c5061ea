"""The Croissant metadata, validated and read by mlcroissant without a network."""

import hashlib
import json
import logging
import socket
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet
import pytest

from copolicy.cards.cli import main
from copolicy.cards.croissant import REPOSITORY
from copolicy.convert.cli import main as convert
from copolicy.dataset.episode import EPISODE_COLUMNS
from copolicy.dataset.versions.release import release

# rdflib 7, which mlcroissant reads JSON-LD with, uses a class of its own that it deprecated.
pytestmark = pytest.mark.filterwarnings("ignore:ConjunctiveGraph is deprecated:DeprecationWarning:rdflib")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory, upstream) -> Path:
    """The original program's raw example episodes as a released LeRobot data set with Croissant metadata."""
    root = tmp_path_factory.mktemp("croissant") / "table"
    raw = str(upstream / "examples_scripted" / "raw")
    assert convert(["upstream", raw, "--out", str(root), "--repo-id", "lab/table", "--license", "cc-by-4.0"]) == 0
    release(root, "minor", "the first")
    assert main(["dataset", str(root), "--repo-id", "lab/table", "--croissant", "--no-figures"]) == 0
    return root


@pytest.fixture
def offline(monkeypatch):
    """Any use of the network fails."""

    def refuse(*arguments, **named):
        raise OSError("these tests have no network")

    monkeypatch.setattr(socket.socket, "connect", refuse)
    monkeypatch.setattr(socket, "getaddrinfo", refuse)


def metadata(root: Path) -> dict:
    return json.loads((root / "meta" / "croissant.json").read_text(encoding="utf-8"))


def test_the_validator_finds_nothing(dataset, offline, caplog):
    import mlcroissant

    with caplog.at_level(logging.WARNING):
        by_content = mlcroissant.Dataset(jsonld=metadata(dataset), mapping={REPOSITORY: str(dataset)})
        by_file = mlcroissant.Dataset(jsonld=dataset / "meta" / "croissant.json", mapping={REPOSITORY: str(dataset)})
    for loaded in (by_content, by_file):
        issues = loaded.metadata.ctx.issues
        assert (issues.errors, issues.warnings) == (set(), set())
    assert caplog.records == []
    assert by_content.metadata.version == "0.1.0"
    assert [records.uuid for records in by_content.metadata.record_sets] == ["frames", "episodes"]


def test_an_unreleased_data_set_lacks_version_and_date_and_nothing_else(dataset, offline):
    import mlcroissant

    fields = metadata(dataset)
    assert fields.pop("version") == "0.1.0"
    assert fields.pop("datePublished")
    issues = mlcroissant.Dataset(jsonld=fields).metadata.ctx.issues
    assert issues.errors == set()
    assert {text.split('"')[1].rpartition("/")[2] for text in issues.warnings} == {"version", "datePublished"}


def test_its_frames_are_those_of_the_data(dataset, offline):
    import mlcroissant

    loaded = mlcroissant.Dataset(jsonld=metadata(dataset), mapping={REPOSITORY: str(dataset)})
    records = list(loaded.records("frames"))
    table = parquet.read_table(dataset / "data" / "chunk-000" / "file-000.parquet")
    assert len(records) == table.num_rows
    for index in (0, table.num_rows // 2, table.num_rows - 1):
        row = table.slice(index, 1).to_pylist()[0]
        assert set(records[index]) == {f"frames/{name}" for name in row}
        for name, value in row.items():
            np.testing.assert_array_equal(records[index][f"frames/{name}"], value, err_msg=name)


def test_its_episodes_are_those_of_the_data(dataset, offline):
    import mlcroissant

    loaded = mlcroissant.Dataset(jsonld=metadata(dataset), mapping={REPOSITORY: str(dataset)})
    rows = parquet.read_table(dataset / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()
    for record, row in zip(loaded.records("episodes"), rows, strict=True):
        assert set(record) == {f"episodes/{name}" for name in ("episode_index", "length", *EPISODE_COLUMNS)}
        for name in EPISODE_COLUMNS:
            stored, value = record[f"episodes/{name}"], row[name]
            if isinstance(value, float) and np.isnan(value):
                value = None
            assert (stored.decode() if isinstance(stored, bytes) else stored) == value, name


def test_every_file_of_the_data_has_its_check_sum(dataset):
    fields = metadata(dataset)
    assert (fields["@type"], fields["conformsTo"]) == ("sc:Dataset", "http://mlcommons.org/croissant/1.0")
    assert fields["license"] == "cc-by-4.0"
    objects = {entry["@id"]: entry for entry in fields["distribution"] if entry["@type"] == "cr:FileObject"}
    assert objects.pop(REPOSITORY)["contentUrl"] == "https://huggingface.co/datasets/lab/table"
    files = [*(dataset / "data").rglob("*.parquet"), *(dataset / "meta" / "episodes").rglob("*.parquet")]
    assert set(objects) == {path.relative_to(dataset).as_posix() for path in files}
    for name, entry in objects.items():
        assert entry["sha256"] == hashlib.sha256((dataset / name).read_bytes()).hexdigest()


def test_images_are_no_columns(dataset, tmp_path):
    from copolicy.cards.croissant import croissant_metadata
    from copolicy.cards.facts import DatasetFacts

    facts = DatasetFacts.read(dataset)
    scene = {"dtype": "video", "shape": [96, 96, 3], "names": ["height", "width", "channels"]}
    facts.info["features"]["observation.images.scene"] = scene
    frames, _ = croissant_metadata(facts, "lab/table")["recordSet"]
    assert [field["@id"] for field in frames["field"]] == [
        f"frames/{name}" for name in facts.info["features"] if name != "observation.images.scene"
    ]


def test_croissant_needs_a_repo_id(dataset, capsys):
    assert main(["dataset", str(dataset), "--croissant", "--no-figures", "--overwrite"]) == 2
    expected = "--repo-id: expected user/name with --croissant, which states the data's location, found None"
    assert capsys.readouterr().err == f"copolicy-cards: {expected}\n"
