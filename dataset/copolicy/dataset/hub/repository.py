"""What the Hub holds of one data set repository: its head and its tags."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

from .client import HfApi, RemoteEntryNotFoundError, RepositoryNotFoundError, hub_errors

BRANCH = "main"


@dataclass(frozen=True)
class Repository:
    """A data set repository as it was when asked.

    Attributes:
        head: commit of `main`.
        tags: commit of each tag.
    """

    repo_id: str
    private: bool
    head: str
    tags: dict[str, str]


def read_repository(api: HfApi, repo_id: str) -> Repository | None:
    """Head and tags, or `None` where the Hub has no such data set that the token may see.

    Raises:
        HubError: the Hub does not answer, or does not accept the token.
    """
    with hub_errors(repo_id, "asking the Hub"):
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
    """A small file at a commit, or `None` where it holds none.

    Raises:
        HubError: the Hub does not answer.
    """
    with hub_errors(repo_id, f"reading {path}"), tempfile.TemporaryDirectory() as folder:
        try:
            local = api.hf_hub_download(repo_id, path, repo_type="dataset", revision=commit, local_dir=folder)
        except RemoteEntryNotFoundError:
            return None
        return Path(local).read_bytes()
