"""Pulling through the real client over HTTP, with faults.

| fault | what the user sees | what a rerun does |
|---|---|---|
| a dropped connection in the middle of a file, once | nothing: the client asks for it again | |
| 500, or a connection that drops, for good | one line; nothing at OUT | fetches only what did not arrive |
| a file that is not what was released | one line naming it; nothing is kept | the same, until the Hub is right |
| no such data set, revision or version; no token for a private one | one line | |
"""

import errno
import json
import os
import shutil
from pathlib import Path

import pytest
from full_disk import full_disk
from hub_user import HubUser
from local_hub import LocalHub
from versioned_data_set import EPISODES, FRAMES, set_value, simulated_data_set

from copolicy.dataset.files.meta_files import MANIFEST_FILE
from copolicy.dataset.versions.content import read_content
from copolicy.dataset.versions.manifest import Manifest
from copolicy.dataset.versions.release import release


@pytest.fixture(scope="module")
def released(tmp_path_factory) -> Path:
    root = simulated_data_set(tmp_path_factory.mktemp("pull") / "table")
    release(root, "major", "The first.")
    return root


@pytest.fixture(scope="module")
def user(tmp_path_factory, released):
    """A user who has published 1.0.0 with recordings as lab/table."""
    with LocalHub() as hub, HubUser(hub, tmp_path_factory.mktemp("home")) as user:
        done = user.run("publish", released, "--repo-id", "lab/table", "--raw", released.parent / "recordings")
        assert done.status == 0, done.err
        yield user


@pytest.fixture
def hub(user):
    """The hub with that data set, restored afterwards."""
    repository = user.hub.data_set("lab/table")
    before = dict(repository.commits), dict(repository.branches), dict(repository.tags), repository.private
    user.hub.requests.clear()
    yield user.hub
    user.hub.faults.clear()
    repository.commits, repository.branches, repository.tags, repository.private = before


def files_of(root: Path) -> dict[str, bytes]:
    return {path.relative_to(root).as_posix(): path.read_bytes() for path in root.rglob("*") if path.is_file()}


def test_pulled_files_equal_the_published_files(user, hub, released, tmp_path):
    done = user.run("pull", "lab/table@data-1.0.0", "--out", tmp_path / "out", "--json")
    assert done.status == 0, done.err
    assert files_of(tmp_path / "out") == files_of(released)
    assert json.loads(done.out) == {
        "root": str(tmp_path / "out"),
        "repo_id": "lab/table",
        "revision": "data-1.0.0",
        "commit": hub.data_set("lab/table").tags["data-1.0.0"],
        "version": "1.0.0",
        "content_hash": read_content(released).hash,
        "files": len(files_of(released)),
    }
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert user.run("diff", tmp_path / "out", "lab/table@data-1.0.0").status == 0


def test_a_full_disk_leaves_nothing_at_out(user, hub, tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    with full_disk(3_000), HubUser(hub, home) as limited:  # its process inherits the limit
        done = limited.run("pull", "lab/table", "--out", tmp_path / "out")
    assert done.status == 1
    assert len(done.err.splitlines()) == 1, done.err
    assert done.err.startswith(f"copolicy-dataset: {tmp_path / 'out'}")
    assert os.strerror(errno.EFBIG) in done.err
    assert not (tmp_path / "out").exists()
    assert user.run("pull", "lab/table", "--out", tmp_path / "out").status == 0
    assert {path.name for path in tmp_path.iterdir()} == {"home", "out"}


def test_recordings_are_pulled_with_the_flag(user, hub, released, tmp_path):
    assert user.run("pull", "lab/table", "--out", tmp_path / "out", "--with-raw").status == 0
    recordings = files_of(released.parent / "recordings")
    assert {name: (tmp_path / "out" / "raw" / name).read_bytes() for name in recordings} == recordings
    # What was pulled can be published as it is.
    done = user.run("publish", tmp_path / "out", "--repo-id", "lab/copy", "--raw", tmp_path / "out" / "raw")
    assert done.status == 0, done.err
    assert hub.data_set("lab/copy").head == hub.data_set("lab/table").head
    del hub.repositories["dataset", "lab/copy"]


def test_the_newest_version_is_pulled_by_default_and_an_older_one_by_name(user, hub, released, tmp_path):
    other = Path(shutil.copytree(released, tmp_path / "other"))
    set_value(other, EPISODES, "pair_id", 0, "pair-9")
    release(other, "patch", "Corrected.")
    assert user.run("publish", other, "--repo-id", "lab/table").status == 0
    assert user.run("pull", "lab/table", "--out", tmp_path / "new").status == 0
    assert user.run("pull", "lab/table@data-1.0.0", "--out", tmp_path / "old").status == 0
    assert read_content(tmp_path / "new").hash == read_content(other).hash
    assert read_content(tmp_path / "old").hash == read_content(released).hash
    assert user.run("diff", "lab/table@data-1.0.0", "lab/table@data-1.0.1").status == 1


def test_an_interrupted_file_is_downloaded_again(user, hub, released, tmp_path):
    hub.drop("GET", rf"/resolve/.*/{FRAMES}$", "middle")
    assert user.run("pull", "lab/table", "--out", tmp_path / "out").status == 0
    assert files_of(tmp_path / "out") == files_of(released)
    assert sum(method == "GET" and path.endswith(FRAMES) for method, path, _ in hub.requests) == 2


@pytest.mark.parametrize("fault", ["500", "drop"])
def test_a_failed_download_resumes(user, hub, released, tmp_path, fault):
    path = rf"/resolve/.*/{FRAMES}$"
    if fault == "500":
        hub.fail("GET", path, 500, times=100)
    else:
        hub.drop("GET", path, "before", times=100)
    message = user.run("pull", "lab/table", "--out", tmp_path / "out").error
    assert message.startswith("lab/table: downloading: ")
    assert message.endswith("; run the command again to continue")
    assert not (tmp_path / "out").exists()
    hub.faults.clear()
    hub.requests.clear()
    assert user.run("pull", "lab/table", "--out", tmp_path / "out").status == 0
    assert files_of(tmp_path / "out") == files_of(released)
    fetched = [path for method, path, _ in hub.requests if method == "GET" and "/resolve/" in path]
    assert any(path.endswith(FRAMES) for path in fetched)
    assert len(fetched) < len(files_of(released))
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def tamper(hub: LocalHub, name: str, data: bytes | None) -> None:
    """Moves the tag to a commit with a changed file."""
    repository = hub.data_set("lab/table")
    files = {**repository.head, name: data}
    repository.tags["data-1.0.0"] = repository.commit(
        {name: data for name, data in files.items() if data is not None}, "tampered"
    )


_UNEXPECTED = "expected the files in its manifest, found"
TAMPERED = {
    "other card": ("README.md", b"theirs", f"{_UNEXPECTED} README.md has other content; nothing was kept"),
    "a file more": ("notes.txt", b"x", f"{_UNEXPECTED} notes.txt is not in the manifest; nothing was kept"),
    "a file less": ("meta/stats.json", None, f"{_UNEXPECTED} meta/stats.json is missing; nothing was kept"),
    "no manifest": (
        "meta/manifest.json",
        None,
        "the download is not a release: meta/manifest.json: expected a manifest",
    ),
    "no release": ("meta/copolicy_release.json", None, "the download is not a release: expected a release"),
}


@pytest.mark.parametrize("what", TAMPERED)
def test_files_that_differ_from_the_release_are_deleted(user, hub, tmp_path, what):
    name, data, message = TAMPERED[what]
    tamper(hub, name, data)
    found = user.run("pull", "lab/table@data-1.0.0", "--out", tmp_path / "out").error
    assert found.startswith(f"lab/table@data-1.0.0: {message}")
    assert list(tmp_path.iterdir()) == []


def test_the_content_hash_detects_changed_data_with_a_matching_manifest(user, hub, released, tmp_path):
    other = Path(shutil.copytree(released, tmp_path / "other"))
    set_value(other, FRAMES, "action[0]", 0, 0.5)
    (other / MANIFEST_FILE).write_text(Manifest.from_folder(other).to_text(), encoding="utf-8")
    for name in (FRAMES, MANIFEST_FILE):
        tamper(hub, name, (other / name).read_bytes())
    found = user.run("pull", "lab/table@data-1.0.0", "--out", tmp_path / "out").error
    expected = f"expected content {read_content(released).hash}, found {read_content(other).hash}; nothing was kept"
    assert found == f"lab/table@data-1.0.0: {expected}"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("lab/nothing", "lab/nothing: no such data set on the Hub, or a private one that the token cannot read"),
        ("lab/table@data-9.0.0", "lab/table@data-9.0.0: querying the Hub: no such revision"),
    ],
)
def test_a_missing_data_set_or_revision_is_reported(user, hub, tmp_path, name, message):
    assert user.run("pull", name, "--out", tmp_path / "out").error == message
    assert list(tmp_path.iterdir()) == []


def test_a_private_data_set_requires_a_token(user, hub, tmp_path):
    hub.data_set("lab/table").private = True
    assert user.run("pull", "lab/table", "--out", tmp_path / "out", token=None).error == (
        "lab/table: querying the Hub: the Hub rejected the token, or a private data set needs one; "
        "set HF_TOKEN or run `hf auth login`"
    )


def test_a_data_set_without_version_tags_is_refused(user, hub, tmp_path):
    hub.data_set("lab/table").tags = {"v3.0": hub.data_set("lab/table").branches["main"]}
    assert user.run("pull", "lab/table", "--out", tmp_path / "out").error == (
        "lab/table: expected a tag data-x.y.z on the Hub, found ['v3.0']"
    )


def test_nothing_is_overwritten(user, hub, tmp_path):
    (tmp_path / "out").mkdir()
    done = user.run("pull", "lab/table", "--out", tmp_path / "out")
    assert (done.status, hub.requests) == (2, [])
    assert "found one; nothing was overwritten" in done.err
