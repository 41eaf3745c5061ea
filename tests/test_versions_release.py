import datetime
import json
import os
import shutil
from pathlib import Path

import pytest
from versioned_data_set import (
    EPISODES,
    FRAMES,
    change_json,
    cut_differently,
    keep_episodes,
    set_value,
    simulated_data_set,
)

from copolicy.dataset.cli import main
from copolicy.dataset.exceptions import CopolicyError, FileFormatError, InvalidValueError, UnknownNameError
from copolicy.dataset.files.meta_files import MANIFEST_FILE, RELEASE_FILE
from copolicy.dataset.lerobot_folder.exclusions import exclude
from copolicy.dataset.publication.data_version import DataVersion, newest_version
from copolicy.dataset.versions.content import read_content
from copolicy.dataset.versions.difference import Change
from copolicy.dataset.versions.manifest import Manifest
from copolicy.dataset.versions.release import changelog_with_release, release
from copolicy.dataset.versions.release_record import ReleaseRecord, read_release

DAY = datetime.date(2026, 3, 1)


@pytest.fixture(scope="module")
def converted(tmp_path_factory) -> Path:
    return simulated_data_set(tmp_path_factory.mktemp("release") / "table")


@pytest.fixture(scope="module")
def released_once(converted, tmp_path_factory) -> Path:
    root = Path(shutil.copytree(converted, tmp_path_factory.mktemp("released") / "table"))
    release(root, "major", "The first.", DAY)
    return root


@pytest.fixture
def dataset(converted, tmp_path) -> Path:
    return Path(shutil.copytree(converted, tmp_path / "table"))


@pytest.fixture
def released(released_once, tmp_path) -> Path:
    """A copy of a data set at 1.0.0 that a test may change."""
    return Path(shutil.copytree(released_once, tmp_path / "table"))


def test_the_summary_of_the_command(dataset, capsys):
    assert main(["release", str(dataset), "--bump", "minor", "--notes", "Examples.", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary == {
        "version": "0.1.0",
        "tag": "data-0.1.0",
        "content_hash": read_content(dataset).hash,
        "episodes": 6,
        "changes": [
            f"6 episodes added, {json.loads((dataset / 'meta/info.json').read_bytes())['total_frames']} frames"
        ],
    }
    assert not list(dataset.rglob("*.part"))


def test_the_manifest_names_every_file(released):
    manifest = Manifest.read(released / MANIFEST_FILE)
    files = {path.relative_to(released).as_posix() for path in released.rglob("*") if path.is_file()}
    assert set(manifest.files) == files - {MANIFEST_FILE}
    assert manifest.differences(Manifest.from_folder(released)) == []
    assert manifest.files["README.md"].size == (released / "README.md").stat().st_size


def test_a_manifest_lists_differences(released):
    manifest = Manifest.read(released / MANIFEST_FILE)
    (released / "README.md").write_text("other", encoding="utf-8")
    (released / "meta" / "stats.json").unlink()
    (released / "notes").mkdir()
    (released / "notes" / "routes.png").write_bytes(b"")
    (released / ".cache").mkdir()
    (released / ".cache" / "x").write_text("", encoding="utf-8")
    (released / "raw").mkdir()
    (released / "raw" / "one.mcap").write_text("", encoding="utf-8")
    assert manifest.differences(Manifest.from_folder(released)) == [
        "README.md has other content",
        "meta/stats.json is missing",
        "notes/routes.png is not in the manifest",
    ]


def test_a_release_without_a_change_is_refused(released, capsys):
    before = {path: path.read_bytes() for path in released.rglob("*") if path.is_file()}
    assert main(["release", str(released), "--bump", "major", "--notes", "Again."]) == 1
    assert capsys.readouterr().err == (
        f"copolicy-dataset: {released}: expected a change since release 1.0.0, found none; nothing was written\n"
    )
    assert {path: path.read_bytes() for path in released.rglob("*") if path.is_file()} == before


CHANGES = {
    "patch: a pair": lambda root: set_value(root, EPISODES, "pair_id", 2, "pair-9"),
    "patch: the card": lambda root: (root / "README.md").write_text("other", encoding="utf-8"),
    "patch: the layout": cut_differently,
    "minor: exclusions": lambda root: exclude(root, ["2"], "stuck"),
    "major: a frame": lambda root: set_value(root, FRAMES, "action[3]", -1, 0.123),
    "major: the rate": lambda root: change_json(root, "meta/info.json", lambda info: info.update(fps=15)),
    "major: an episode less": lambda root: keep_episodes(root, [0, 1, 2, 3, 4]),
    "major: another order": lambda root: keep_episodes(root, [1, 0, 2, 3, 4, 5]),
    "major: a name": lambda root: change_json(
        root, "meta/info.json", lambda info: info["features"]["action"].update(names=["a", "b", "c", "d"])
    ),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_bump_smaller_than_the_change_is_refused(released, change):
    CHANGES[change](released)
    needed = change.split(":")[0]
    for bump in {"patch": (), "minor": ("patch",), "major": ("patch", "minor")}[needed]:
        with pytest.raises(InvalidValueError, match=rf"--bump: expected {needed} or larger \(.+\), found '{bump}'"):
            release(released, bump, "Next.", DAY)
        assert read_release(released).version == "1.0.0"
    record = release(released, needed, "Next.", DAY)  # type: ignore[arg-type]
    assert record.version == {"patch": "1.0.1", "minor": "1.1.0", "major": "2.0.0"}[needed]
    with pytest.raises(CopolicyError, match=r"found none; nothing was written"):
        release(released, "major", "Again.", DAY)


def test_added_episodes_require_minor(dataset, tmp_path):
    whole = shutil.copytree(dataset, tmp_path / "whole")
    keep_episodes(dataset, [0, 1, 2, 3])
    release(dataset, "major", "Four.", DAY)
    for folder in ("data", "meta/episodes"):
        shutil.copytree(whole / folder, dataset / folder, dirs_exist_ok=True)
    shutil.copy(whole / "meta/info.json", dataset / "meta/info.json")
    with pytest.raises(InvalidValueError, match=r"--bump: expected minor or larger \(2 episodes added: .+\)"):
        release(dataset, "patch", "Two more.", DAY)
    record = release(dataset, "minor", "Two more.", DAY)
    assert record.version == "1.1.0"
    assert len(record.changes) == 1
    assert record.content_hash == read_content(whole).hash


def test_the_change_log_follows_keep_a_changelog(released):
    set_value(released, EPISODES, "pair_id", 2, "pair-9")
    text = (
        (released / "CHANGELOG.md")
        .read_text(encoding="utf-8")
        .replace("## [1.0.0]", "## [Unreleased]\n- a plan\n\n## [1.0.0]")
    )
    (released / "CHANGELOG.md").write_text(text, encoding="utf-8")
    record = release(released, "patch", "The pair had a wrong name.", datetime.date(2026, 4, 2))
    lines = (released / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if line.startswith("## ")] == [
        "## [Unreleased]",
        "## [1.0.1] - 2026-04-02",
        "## [1.0.0] - 2026-03-01",
    ]
    assert lines[0] == "# Changelog"
    assert "The pair had a wrong name." in lines
    assert f"Content hash: `{record.content_hash}`" in lines
    assert sum(line.startswith("- 1 episode with other values of pair_id: ") for line in lines) == 1


def test_a_hand_written_head_of_the_change_log_is_kept():
    text = changelog_with_release(
        "# Our table\nBy us.\n", "1.0.0", "2026-03-01", "N.", [Change("major", "task 'a' removed")], "h"
    )
    assert text == (
        "# Our table\nBy us.\n\n## [1.0.0] - 2026-03-01\n\nN.\n\nContent hash: `h`\n\n### Removed\n- task 'a' removed\n"
    )


def test_earlier_releases_can_be_read(released):
    first = read_release(released)
    set_value(released, EPISODES, "pair_id", 2, "pair-9")
    release(released, "patch", "Corrected.", DAY)
    assert read_release(released, "1.0.0") == first
    assert read_release(released, "data-1.0.1") == read_release(released)
    with pytest.raises(UnknownNameError, match=r"unknown release of .+table '3.0.0'; available: 1.0.0, 1.0.1"):
        read_release(released, "3.0.0")


@pytest.mark.parametrize("renames", range(5))
def test_an_interrupted_release_can_be_repeated(released, monkeypatch, renames):
    """Simulates a power failure after this many files were renamed."""
    set_value(released, EPISODES, "pair_id", 2, "pair-9")
    really_replace, done = os.replace, []

    def replace(source, target):
        if len(done) == renames:
            raise OSError("power failure")
        done.append(target)
        really_replace(source, target)

    monkeypatch.setattr(os, "replace", replace)
    if renames < 4:
        with pytest.raises(OSError, match="power failure"):
            release(released, "patch", "Corrected.", DAY)
        assert read_release(released).version == "1.0.0"
    monkeypatch.setattr(os, "replace", really_replace)
    assert release(released, "patch", "Corrected.", DAY).version == "1.0.1"
    assert (released / "CHANGELOG.md").read_text(encoding="utf-8").count("## [1.0.1]") == 1
    assert Manifest.read(released / MANIFEST_FILE).differences(Manifest.from_folder(released)) == []
    assert not list(released.rglob("*.part"))


@pytest.mark.parametrize("notes", ["", "  \n", "Fine.\n## [9.9.9]"])
def test_notes_with_headings_are_refused(dataset, notes):
    with pytest.raises(InvalidValueError, match=r"--notes: expected a text without lines that begin with '## '"):
        release(dataset, "major", notes, DAY)
    assert not (dataset / "CHANGELOG.md").exists()


def test_an_inconsistent_record_is_refused(released):
    path = released / RELEASE_FILE
    fields = json.loads(path.read_text(encoding="utf-8"))
    fields["content"]["episodes"][0]["digest"] = "0" * 64
    path.write_text(json.dumps(fields), encoding="utf-8")
    with pytest.raises(FileFormatError, match=r"found a content hash that is not that of the episodes"):
        ReleaseRecord.read(path)
    path.write_text("{", encoding="utf-8")
    with pytest.raises(
        FileFormatError, match=r"expected the record of a release \(copolicy-release-1\), found invalid JSON"
    ):
        read_release(released)


def test_versions_are_ordered_by_number():
    assert newest_version(["v3.0", "data-1.9.0", "data-1.10.0", "data-draft", "1.11.0"]) == DataVersion(1, 10, 0)
    assert newest_version(["v3.0"]) is None
    assert DataVersion.parse("data-1.2.3").tag == "data-1.2.3"
    with pytest.raises(InvalidValueError, match=r"data version: expected x.y.z or data-x.y.z, found '1.2'"):
        DataVersion.parse("1.2")
