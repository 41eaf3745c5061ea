"""Publishes a released data set: one commit, then its tags.

The data tag is set last, so an existing tag means that the publication is complete. An interrupted call can be
repeated: uploaded files are not sent again, an existing commit is recognised by its manifest, and the remaining steps
are done.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..checks.checking import check_dataset
from ..exceptions import FileFormatError, RunError
from ..files.json_file import parse_json
from ..files.meta_files import (
    CARD_FILE,
    CHECK_FILE,
    CROISSANT_FILE,
    MANIFEST_FILE,
    RAW_MANIFEST_FILE,
    RELEASE_FILE,
)
from ..files.staging import replace_text
from ..hub.client import CommitOperationAdd, CommitOperationDelete, HfApi, hub_api, hub_errors
from ..hub.repository import BRANCH, Repository, read_file, read_repository
from ..lerobot_folder.exclusions import excluded_episodes
from ..lerobot_folder.info import read_info
from ..publication.data_version import newest_version
from ..publication.minimal_card import is_minimal_card
from ..publication.repo_id import checked_repo_id
from ..versions.content import read_content
from ..versions.manifest import Manifest
from ..versions.release_record import ReleaseRecord, read_release
from .raw_recordings import RawRecordings, find_raw_recordings, remaining_recordings

_DATA_FOLDERS = ("data/", "meta/", "videos/")


@dataclass(frozen=True)
class PublishResult:
    """The published state on the Hub.

    Attributes:
        committed: False if an earlier, interrupted call had made the commit.
    """

    repo_id: str
    tag: str
    commit: str
    content_hash: str
    files: int
    committed: bool
    recordings_left_out: list[str]


def publish(
    root: Path, repo_id: str, private: bool = False, raw: Path | None = None, with_excluded: bool = False
) -> PublishResult:
    """Checks the data set, uploads its newest release and tags it.

    Args:
        private: create a private repository; an existing one must be private.
        raw: folder of the recordings that the episodes were made from, uploaded as `raw/`.
        with_excluded: upload excluded episodes too; not every trainer leaves them out.

    Raises:
        FileFormatError: no release, no card, or no data set.
        RunError: a check finds an error; the folder differs from its release; it has excluded episodes and
            `with_excluded` is off; this version, or a newer one, is on the Hub.
        HubError: a request to the Hub failed.
    """
    checked_repo_id(repo_id)
    record, manifest = verify_release(root)
    _require_check_passed(root)
    if not with_excluded:
        _require_none_excluded(root)
    recordings = find_raw_recordings(root, raw) if raw is not None else None
    codebase_tag = read_info(root)["codebase_version"]
    api = hub_api()
    repository = read_repository(api, repo_id)
    if repository is None:
        with hub_errors(repo_id, "creating the repository"):
            api.create_repo(repo_id, repo_type="dataset", private=private, exist_ok=True)
        repository = read_repository(api, repo_id)
        if repository is None:
            raise RunError(f"{repo_id}: expected the repository just created, found none")
    if private and not repository.private:
        raise RunError(f"{repo_id}: expected a private repository, found a public one; nothing was uploaded")
    _require_unpublished(api, repository, record)
    commit = _find_head(api, repository, manifest, recordings)
    committed = commit is None
    if commit is None:
        commit = _commit(api, repository, root, record, manifest, recordings)
    with hub_errors(repo_id, f"setting the tags {codebase_tag} and {record.data_version.tag}"):
        _set_tag(api, repository, codebase_tag, commit)
        api.create_tag(repo_id, tag=record.data_version.tag, revision=commit, repo_type="dataset")
    files = len(manifest.files) + 1 + (len(recordings.files) + 1 if recordings else 0)
    left_out = recordings.left_out if recordings else []
    return PublishResult(repo_id, record.data_version.tag, commit, record.content_hash, files, committed, left_out)


def _require_check_passed(root: Path) -> None:
    result = check_dataset(root)
    if result.failed():
        raise RunError(
            f"{root}: expected a data set that passes copolicy-dataset check, found {result.count('error')} errors, "
            f"first {result.findings[0]}"
        )


def _require_none_excluded(root: Path) -> None:
    excluded = [entry.episode for entry in excluded_episodes(root)]
    if excluded:
        listed = ", ".join(map(str, excluded[:12])) + (", ..." if len(excluded) > 12 else "")
        raise RunError(
            f"{root}: expected a release without excluded episodes, found {len(excluded)} ({listed}); nothing was "
            f"uploaded; `copolicy-dataset select {root} --out NEW --drop-excluded` removes them (then release NEW), "
            "--with-excluded uploads them"
        )


def verify_release(root: Path) -> tuple[ReleaseRecord, Manifest]:
    """Checks that the folder matches its newest release, and updates the manifest if card files changed.

    Card, figures, report, Croissant metadata and check findings may be rewritten after a release, so that they can
    name its version; data and other metadata must not change.

    Raises:
        FileFormatError: no release, no card, a damaged manifest, or no data set.
        RunError: data or metadata changed since the release.
    """
    record = read_release(root)
    minimal = is_minimal_card(root / CARD_FILE)
    if minimal or not (root / CARD_FILE).is_file():
        found = "the minimal one of copolicy-convert" if minimal else "none"
        raise FileFormatError(root, f"a card ({CARD_FILE}); make one with copolicy-cards dataset", found)
    released, present = Manifest.read(root / MANIFEST_FILE), Manifest.from_folder(root)
    differences = released.differences(present)
    unchecked = {CHECK_FILE, CROISSANT_FILE}
    changed = [line for line in released.differences(present, without=unchecked) if line.startswith(_DATA_FOLDERS)]
    content_hash = read_content(root).hash
    if content_hash != record.content_hash or changed:
        reason = changed[0] if changed else f"content hash {content_hash}"
        raise RunError(f"{root}: expected the content of release {record.version}, found {reason}; release it first")
    if differences:
        replace_text(root / MANIFEST_FILE, present.to_text())
    return record, present


def _require_unpublished(api: HfApi, repository: Repository, record: ReleaseRecord) -> None:
    tag = record.data_version.tag
    if tag in repository.tags:
        text = read_file(api, repository.repo_id, repository.tags[tag], RELEASE_FILE)
        name = f"{RELEASE_FILE} of {tag} in {repository.repo_id}"
        published = parse_json(text, dict[str, Any], "the record of a release", name) if text else {}
        content_hash = published.get("content_hash")
        description = "this content" if content_hash == record.content_hash else f"other content ({content_hash})"
        raise RunError(f"{repository.repo_id}: {tag} is on the Hub already, with {description}; nothing was uploaded")
    latest = newest_version(list(repository.tags))
    if latest is not None and latest > record.data_version:
        raise RunError(
            f"{repository.repo_id}: expected a release after {latest.tag}, which is on the Hub, found {tag}; "
            "nothing was uploaded"
        )


def _find_head(api: HfApi, repository: Repository, manifest: Manifest, recordings: RawRecordings | None) -> str | None:
    """The head commit if it already has exactly the files to be committed, else None."""
    manifests = {MANIFEST_FILE: manifest}
    if recordings is not None:
        manifests[RAW_MANIFEST_FILE] = recordings.manifest
    for name, expected in manifests.items():
        if read_file(api, repository.repo_id, repository.head, name) != expected.to_text().encode():
            return None
    return repository.head


def _commit(
    api: HfApi,
    repository: Repository,
    root: Path,
    record: ReleaseRecord,
    manifest: Manifest,
    recordings: RawRecordings | None,
) -> str:
    sources: dict[str, Path | bytes] = {name: root / name for name in manifest.files}
    sources[MANIFEST_FILE] = manifest.to_text().encode()
    raw_files: set[str] = set()
    if recordings is not None:
        sources.update(recordings.files)
        sources[RAW_MANIFEST_FILE] = recordings.manifest.to_text().encode()
    elif published_manifest := read_file(api, repository.repo_id, repository.head, RAW_MANIFEST_FILE):
        remaining = remaining_recordings(root, Manifest.from_text(published_manifest.decode()))
        raw_files = set(remaining.files)
        if raw_files:
            sources[RAW_MANIFEST_FILE] = remaining.to_text().encode()
    with hub_errors(repository.repo_id, "uploading"):
        files = api.list_repo_files(repository.repo_id, repo_type="dataset", revision=repository.head)
        stale = [name for name in files if not (name in sources or name in raw_files or name.startswith("."))]
        commit = api.create_commit(
            repository.repo_id,
            [
                *(CommitOperationDelete(name) for name in stale),
                *(CommitOperationAdd(name, source) for name, source in sources.items()),
            ],
            commit_message=record.data_version.tag,
            commit_description=f"{record.notes}\n\nContent hash: {record.content_hash}",
            repo_type="dataset",
            revision=BRANCH,
            parent_commit=repository.head,
        )
    return commit.oid


def _set_tag(api: HfApi, repository: Repository, tag: str, commit: str) -> None:
    """Sets a tag such as the format version that LeRobot loads; the Hub cannot move a tag, so it is deleted first."""
    if repository.tags.get(tag) == commit:
        return
    if tag in repository.tags:
        api.delete_tag(repository.repo_id, tag=tag, repo_type="dataset")
    api.create_tag(repository.repo_id, tag=tag, revision=commit, repo_type="dataset")
