"""A data set repository on the Hub: its head, tags, and the files of a revision."""

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

from ..exceptions import RunError
from ..publication.data_version import newest_version
from ..publication.repo_id import checked_repo_id
from .client import HfApi, RemoteEntryNotFoundError, RepositoryNotFoundError, hub_api, hub_errors, snapshot_download

BRANCH = "main"


@dataclass(frozen=True)
class Repository:
    """State of a data set repository at the time of the request.

    Attributes:
        head: commit of `main`.
        tags: commit of each tag.
    """

    repo_id: str
    private: bool
    head: str
    tags: dict[str, str]


def read_repository(api: HfApi, repo_id: str) -> Repository | None:
    """Reads head and tags; `None` if the Hub has no such data set, or the token cannot read it.

    Raises:
        HubError: the Hub does not answer, or rejects the token.
    """
    with hub_errors(repo_id, "querying the Hub"):
        try:
            info = api.dataset_info(repo_id)
            refs = api.list_repo_refs(repo_id, repo_type="dataset")
        except RepositoryNotFoundError as error:
            if error.response.status_code == 404:
                return None
            raise
    heads = {ref.name: ref.target_commit for ref in refs.branches}
    return Repository(
        repo_id,
        bool(info.private),
        heads.get(BRANCH, info.sha or ""),
        {ref.name: ref.target_commit for ref in refs.tags},
    )


def read_file(api: HfApi, repo_id: str, commit: str, path: str) -> bytes | None:
    """Reads a small file at a commit; `None` if the commit has no such file.

    Raises:
        HubError: the Hub does not answer.
    """
    with hub_errors(repo_id, f"reading {path}"), tempfile.TemporaryDirectory() as folder:
        try:
            downloaded = api.hf_hub_download(repo_id, path, repo_type="dataset", revision=commit, local_dir=folder)
        except RemoteEntryNotFoundError:
            return None
        return Path(downloaded).read_bytes()


def resolve(repo_id: str, revision: str | None) -> tuple[str, str]:
    """Resolves a revision to its name and commit; None stands for the newest data version.

    Raises:
        InvalidValueError: `repo_id` is not a valid name.
        HubError: the Hub does not answer, or has no such data set or revision.
        RunError: no data set of that name, or it has no tag of a data version.
    """
    checked_repo_id(repo_id, "data set on the Hub")
    api = hub_api()
    repository = read_repository(api, repo_id)
    if repository is None:
        raise RunError(f"{repo_id}: no such data set on the Hub, or a private one that the token cannot read")
    if revision is None:
        version = newest_version(list(repository.tags))
        if version is None:
            raise RunError(
                f"{repo_id}: expected a tag data-x.y.z on the Hub, found {sorted(repository.tags) or 'none'}"
            )
        revision = version.tag
    if revision in repository.tags:
        return revision, repository.tags[revision]
    with hub_errors(f"{repo_id}@{revision}", "querying the Hub"):
        return revision, api.dataset_info(repo_id, revision=revision).sha or ""


def download(repo_id: str, folder: Path, commit: str, skip: str | None = None) -> None:
    """Downloads the files of a commit into `folder`, or resumes an earlier download there.

    Args:
        skip: pattern of files to leave out.

    Raises:
        HubError: the Hub does not answer; files already downloaded stay in `folder`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with hub_errors(repo_id, "downloading"):
        snapshot_download(
            repo_id,
            repo_type="dataset",
            revision=commit,
            local_dir=folder,
            ignore_patterns=skip,
            max_workers=4,
            library_name="copolicy",
        )


def remove_download_state(folder: Path) -> None:
    """Removes the files that the client keeps to resume a download."""
    shutil.rmtree(folder / ".cache", ignore_errors=True)
