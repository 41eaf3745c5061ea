"""Publishing through the real client over HTTP, with faults.

| fault | what the user sees | what a rerun does |
|---|---|---|
| no token, or a wrong one | one line: the Hub rejected the token; nothing changed | publishes, with a token |
| a token that may only read | one line: the token has no write access | publishes, with another token |
| 500 once or twice | nothing: the client tries again | |
| 500 for good, or a connection that drops, while uploading | one line; no commit | sends only what did not arrive |
| 500 at the commit | one line; no commit | commits; sends no large file again |
| the connection drops after the commit | one line | finds the commit, sets the tags |
| 500 or a dropped connection at a tag | one line | finds the commit, sets what is missing |
| somebody commits meanwhile (409, 412) | one line; no commit of ours | publishes on top of the other's commit |
| the version is on the Hub already, or a newer one | one line; nothing changed | the same |
"""

import hashlib
import json
import shutil
from pathlib import Path

import pytest
from hub_user import Done, HubUser
from local_hub import READ_TOKEN, TOKEN, LocalHub, Repository
from versioned_data_set import EPISODES, FRAMES, keep_episodes, set_value, simulated_data_set

from copolicy.dataset.lerobot_folder.exclusions import exclude
from copolicy.dataset.versions.content import read_content
from copolicy.dataset.versions.release import release

COMMIT, TAG = r"/commit/main$", r"/tag/"


@pytest.fixture(scope="module")
def released_once(tmp_path_factory) -> Path:
    root = simulated_data_set(tmp_path_factory.mktemp("hub") / "table")
    release(root, "major", "The first.")
    return root


@pytest.fixture
def dataset(released_once, tmp_path) -> Path:
    """A copy of a data set at 1.0.0 that a test may change."""
    return Path(shutil.copytree(released_once, tmp_path / "table"))


@pytest.fixture(scope="module")
def user(tmp_path_factory):
    with LocalHub() as hub, HubUser(hub, tmp_path_factory.mktemp("home")) as user:
        yield user


@pytest.fixture
def hub(user) -> LocalHub:
    """An empty hub that works."""
    user.hub.forget()
    return user.hub


@pytest.fixture
def publish(user, dataset):
    """Publishes the data set, or another one."""

    def run(*more: object, root: Path = dataset, token: str | None = TOKEN) -> Done:
        return user.run("publish", root, "--repo-id", "lab/table", "--json", *more, token=token)

    return run


def is_published(hub: LocalHub, root: Path) -> bool:
    repository = hub.data_set("lab/table")
    files = {path.relative_to(root).as_posix(): path.read_bytes() for path in root.rglob("*") if path.is_file()}
    there = {name: data for name, data in repository.head.items() if name != ".gitattributes"}
    return there == files and set(repository.tags.values()) == {repository.branches["main"]}


def test_all_files_are_uploaded_in_one_commit_with_both_tags(hub, dataset, publish):
    (dataset / "figures").mkdir()
    (dataset / "figures" / "routes.png").write_bytes(b"\x89PNG")
    done = publish()
    assert done.status == 0, done.err
    repository = hub.data_set("lab/table")
    assert json.loads(done.out) == {
        "repo_id": "lab/table",
        "tag": "data-1.0.0",
        "commit": repository.branches["main"],
        "content_hash": read_content(dataset).hash,
        "files": sum(path.is_file() for path in dataset.rglob("*")),
        "committed": True,
        "recordings_left_out": [],
    }
    assert is_published(hub, dataset)
    assert "figures/routes.png" in repository.head
    assert set(repository.tags) == {"v3.0", "data-1.0.0"}
    assert [text.splitlines()[0] for text in repository.messages.values()] == ["initial commit", "data-1.0.0"]
    assert not repository.private


def test_the_token_is_not_written_anywhere(hub, dataset, publish):
    hub.fail("POST", COMMIT, 500)
    assert publish().status == 1
    assert publish().status == 0
    written = [path for path in dataset.parent.rglob("*") if path.is_file()]
    stored = [data for files in hub.data_set("lab/table").commits.values() for data in files.values()]
    assert all(TOKEN.encode() not in data for data in [*stored, *(path.read_bytes() for path in written)])
    assert all(TOKEN not in path for _, path, _ in hub.requests)


def test_the_same_version_is_refused_a_second_time(hub, dataset, publish):
    assert publish().status == 0
    before = dict(hub.data_set("lab/table").commits)
    assert publish().error == ("lab/table: data-1.0.0 is on the Hub already, with this content; nothing was uploaded")
    assert hub.data_set("lab/table").commits == before


def test_other_content_under_the_same_version_is_refused(hub, dataset, publish, released_once, tmp_path):
    assert publish().status == 0
    other = Path(shutil.copytree(released_once, tmp_path / "other"))
    (other / "meta/copolicy_release.json").unlink()
    set_value(other, EPISODES, "pair_id", 0, "pair-9")
    release(other, "major", "Another first.")
    there = read_content(dataset).hash
    assert publish(root=other).error == (
        f"lab/table: data-1.0.0 is on the Hub already, with other content ({there}); nothing was uploaded"
    )


def test_the_next_version_moves_the_format_tag_and_deletes_stale_files(hub, dataset, publish, released_once):
    (dataset / "old.txt").write_text("to go", encoding="utf-8")
    assert publish().status == 0
    first = hub.data_set("lab/table").branches["main"]
    (dataset / "old.txt").unlink()
    keep_episodes(dataset, [0, 1, 2, 3, 4])
    release(dataset, "major", "One withdrew.")
    done = publish()
    assert done.status == 0, done.err
    repository = hub.data_set("lab/table")
    second = repository.branches["main"]
    assert repository.tags == {"v3.0": second, "data-1.0.0": first, "data-2.0.0": second}
    assert "old.txt" not in repository.head
    message = (
        "lab/table: expected a release after data-2.0.0, which is on the Hub, found data-1.0.0; nothing was uploaded"
    )
    del repository.tags["data-1.0.0"]
    assert publish(root=released_once).error == message


def test_a_card_made_after_the_release_is_published_with_a_fitting_manifest(hub, dataset, publish):
    (dataset / "README.md").write_text("---\nlicense: mit\n---\n\n# Table 1.0.0\n", encoding="utf-8")
    assert publish().status == 0
    assert is_published(hub, dataset)


def test_croissant_made_after_the_release_is_published_too(hub, dataset, publish):
    (dataset / "meta" / "croissant.json").write_text('{"@type": "sc:Dataset"}', encoding="utf-8")
    assert publish().status == 0
    assert is_published(hub, dataset)


REFUSED = {
    "no release": (
        lambda root: (root / "meta/copolicy_release.json").unlink(),
        2,
        "{root}: expected a release (meta/copolicy_release.json); make one with copolicy-dataset release, found none",
    ),
    "no card": (
        lambda root: (root / "README.md").unlink(),
        2,
        "{root}: expected a card (README.md); make one with copolicy-cards dataset, found none",
    ),
    "changed metadata": (
        lambda root: set_value(root, EPISODES, "pair_id", 0, "pair-9"),
        1,
        "{root}: expected the content of release 1.0.0, found meta/episodes/chunk-000/file-000.parquet has other "
        "content; release it first",
    ),
    "other statistics": (
        lambda root: (root / "meta/stats.json").write_text(
            (root / "meta/stats.json").read_text(encoding="utf-8") + " ", encoding="utf-8"
        ),
        1,
        "{root}: expected the content of release 1.0.0, found meta/stats.json has other content; release it first",
    ),
    "an error that the checks find": (
        lambda root: (set_value(root, FRAMES, "action[0]", 0, 7.0), release(root, "major", "Stronger.")),
        1,
        "{root}: expected a data set that passes copolicy-dataset check, found ",
    ),
}


@pytest.mark.parametrize("reason", REFUSED)
def test_an_unready_data_set_is_refused_before_the_hub_is_queried(hub, dataset, publish, reason):
    change, status, message = REFUSED[reason]
    change(dataset)
    done = publish()
    assert done.status == status
    assert done.err.startswith(f"copolicy-dataset: {message.format(root=dataset)}")
    assert done.err.count("\n") == 1
    assert hub.requests == []


def test_private_refuses_a_public_repository(hub, user, dataset, publish):
    assert publish("--private").status == 0
    assert hub.data_set("lab/table").private
    public = Repository(private=False)
    public.commit({}, "initial commit")
    hub.repositories["dataset", "lab/open"] = public
    done = user.run("publish", dataset, "--repo-id", "lab/open", "--private")
    assert done.error == "lab/open: expected a private repository, found a public one; nothing was uploaded"
    assert public.head == {}


REJECTED = "the Hub rejected the token, or a private data set needs one; set HF_TOKEN or run `hf auth login`"


@pytest.mark.parametrize(
    ("token", "message"),
    [
        ("hf_" + "w" * 34, f"lab/table: querying the Hub: {REJECTED}"),
        (None, f"lab/table: querying the Hub: {REJECTED}"),
        (READ_TOKEN, "lab/table: creating the repository: the token has no write access to the repository"),
    ],
)  # fmt: skip
def test_a_rejected_token_is_reported_but_not_shown(hub, dataset, publish, token, message):
    done = publish(token=token)
    assert done.error == message
    assert token is None or token not in done.err
    assert hub.repositories == {}
    assert publish().status == 0


@pytest.mark.parametrize("path", [r"/preupload/", r"/objects/batch$", r"^/lfs/"])
def test_a_failed_request_is_retried(hub, dataset, publish, path):
    hub.fail("PUT" if "lfs/" in path else "POST", path, 503, times=2)
    done = publish()
    assert done.status == 0, done.err
    assert is_published(hub, dataset)


TROUBLE = "the Hub failed (HTTP 500); run the command again to continue"


def test_a_failed_upload_resumes(hub, dataset, publish):
    oid = hashlib.sha256((dataset / FRAMES).read_bytes()).hexdigest()
    hub.fail("PUT", rf"^/lfs/{oid}", 500, times=6)  # one try and five more
    assert publish().error == f"lab/table: uploading: {TROUBLE}"
    assert set(hub.data_set("lab/table").head) == {".gitattributes"}
    assert hub.data_set("lab/table").tags == {}
    hub.faults.clear()
    assert publish().status == 0
    assert is_published(hub, dataset)
    assert len(hub.uploads) == len(set(hub.uploads)) == 3


def test_a_connection_that_drops_while_uploading(hub, dataset, publish):
    hub.drop("PUT", r"^/lfs/", "before", times=100)
    message = publish().error
    assert message.startswith("lab/table: uploading: the connection was lost (")
    assert message.endswith("); run the command again to continue")
    assert set(hub.data_set("lab/table").head) == {".gitattributes"}
    hub.faults.clear()
    assert publish().status == 0
    assert is_published(hub, dataset)


def test_large_files_are_not_sent_again_after_a_failed_commit(hub, dataset, publish):
    hub.fail("POST", COMMIT, 500)
    assert publish().error == f"lab/table: uploading: {TROUBLE}"
    assert set(hub.data_set("lab/table").head) == {".gitattributes"}
    assert publish().status == 0
    assert is_published(hub, dataset)
    assert len(hub.uploads) == 3


FAULTS_AFTER_THE_COMMIT = {
    "the commit's reply is lost": lambda hub: hub.drop("POST", COMMIT, "after"),
    "the first tag fails": lambda hub: hub.fail("POST", TAG, 500),
    "the first tag's reply is lost": lambda hub: hub.drop("POST", TAG, "after"),
}


@pytest.mark.parametrize("fault", FAULTS_AFTER_THE_COMMIT)
def test_an_existing_commit_is_not_repeated(hub, dataset, publish, fault):
    FAULTS_AFTER_THE_COMMIT[fault](hub)
    assert publish().error.endswith("run the command again to continue")
    assert "data-1.0.0" not in hub.data_set("lab/table").tags
    done = publish()
    assert done.status == 0, done.err
    assert json.loads(done.out)["committed"] is False
    assert is_published(hub, dataset)
    assert len(hub.data_set("lab/table").commits) == 2


def test_a_deleted_format_tag_is_set_again(hub, dataset, publish):
    assert publish().status == 0
    set_value(dataset, EPISODES, "pair_id", 0, "pair-9")
    release(dataset, "patch", "Corrected.")
    hub.fail("POST", TAG, 500)
    message = publish().error
    assert message == f"lab/table: setting the tags v3.0 and data-1.0.1: {TROUBLE}"
    assert set(hub.data_set("lab/table").tags) == {"data-1.0.0"}
    assert publish().status == 0
    repository = hub.data_set("lab/table")
    assert repository.tags["v3.0"] == repository.tags["data-1.0.1"] == repository.branches["main"]


def test_a_concurrent_commit_is_not_overwritten(hub, dataset, publish):
    def commit():
        repository = hub.data_set("lab/table")
        repository.commit({**repository.head, "README.md": b"theirs"}, "their card")

    hub.meanwhile("POST", COMMIT, commit)
    assert publish().error == (
        "lab/table: uploading: the repository was changed by another commit; check the changes and run "
        "the command again"
    )
    repository = hub.data_set("lab/table")
    assert repository.head["README.md"] == b"theirs"
    assert repository.tags == {}
    assert publish().status == 0
    assert is_published(hub, dataset)
    assert [text.splitlines()[0] for text in repository.messages.values()][1:] == ["their card", "data-1.0.0"]


def test_a_conflict_that_the_hub_reports_itself(hub, dataset, publish):
    hub.fail("POST", COMMIT, 409)
    assert "the repository was changed by another commit" in publish().error
    assert publish().status == 0


def test_only_the_recordings_of_the_episodes_are_uploaded(hub, dataset, publish, released_once):
    recordings = Path(shutil.copytree(released_once.parent / "recordings", dataset.parent / "recordings"))
    (recordings / "discarded.mcap").write_bytes(b"nobody agreed to this")
    done = publish("--raw", recordings)
    assert done.status == 0, done.err
    assert json.loads(done.out)["recordings_left_out"] == ["discarded.mcap"]
    names = [name for name in hub.data_set("lab/table").head if name.startswith("raw/")]
    assert names == [*(f"raw/episode_{index:06}.mcap" for index in range(6)), "raw/manifest.json"]
    # The recording of an episode that went goes, too, even when the next release comes without recordings.
    keep_episodes(dataset, [0, 2, 3, 4, 5])
    release(dataset, "major", "One withdrew.")
    assert publish().status == 0
    left = [name for name in hub.data_set("lab/table").head if name.startswith("raw/")]
    assert left == [*(f"raw/episode_{index:06}.mcap" for index in (0, 2, 3, 4, 5)), "raw/manifest.json"]


def test_missing_recordings_are_refused(hub, dataset, publish, released_once):
    recordings = Path(shutil.copytree(released_once.parent / "recordings", dataset.parent / "recordings"))
    (recordings / "episode_000003.mcap").unlink()
    message = publish("--raw", recordings).error
    assert message.startswith(f"{recordings}: expected the recording of every episode, found 1 missing, first that of ")
    assert hub.requests == []


def test_an_invalid_name_is_refused(hub, user, dataset):
    done = user.run("publish", dataset, "--repo-id", "table")
    assert (done.status, hub.requests) == (2, [])
    assert done.err == (
        "copolicy-dataset: --repo-id: expected USER/NAME that the Hub accepts (one slash between user and name), "
        "found 'table'\n"
    )


def test_excluded_episodes_are_uploaded_only_with_the_flag(hub, dataset, publish):
    exclude(dataset, ["1"], "a stick was unplugged")
    release(dataset, "minor", "One episode excluded.")
    done = publish()
    assert done.status == 1
    assert "found 1 (1); nothing was uploaded" in done.err
    assert f"copolicy-dataset select {dataset} --out NEW --drop-excluded" in done.err
    assert "--with-excluded uploads them" in done.err
    assert len(done.err.splitlines()) == 1
    assert not hub.repositories
    assert publish("--with-excluded").status == 0
    assert is_published(hub, dataset)
