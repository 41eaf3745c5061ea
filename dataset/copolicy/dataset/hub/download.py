"""Downloads one revision of a data set from the Hub."""

import shutil
from pathlib import Path

from ..exceptions import RunError
from ..publication.data_version import newest
from ..publication.repo_id import checked_repo_id
from .client import hub_api, hub_errors, snapshot_download
from .repository import read_repository


def resolve(repo_id: str, revision: str | None) -> tuple[str, str]:
    """Name and commit of a revision; the newest data version where none is asked for.

    Raises:
        InvalidValueError: `repo_id` is no name.
        HubError: the Hub does not answer, or has no such data set or revision.
        RunError: no data set of that name, or none of its versions is tagged.
    """
    checked_repo_id(repo_id, "data set on the Hub")
    api = hub_api()
    repository = read_repository(api, repo_id)
    if repository is None:
        raise RunError(f"{repo_id}: no such data set on the Hub, or a private one that the token may not see")
    if revision is None:
        version = newest(list(repository.tags))
        if version is None:
            raise RunError(
                f"{repo_id}: expected a tag data-x.y.z on the Hub, found {sorted(repository.tags) or 'none'}"
            )
        revision = version.tag
    if revision in repository.tags:
        return revision, repository.tags[revision]
    with hub_errors(f"{repo_id}@{revision}", "asking the Hub"):
        return revision, api.dataset_info(repo_id, revision=revision).sha or ""


def download(repo_id: str, folder: Path, commit: str, skip: str | None = None) -> None:
    """Downloads the files of a commit into `folder`, going on with what an earlier call left there.

    Args:
        skip: pattern of files that are not wanted.

    Raises:
        HubError: the Hub does not answer; what arrived stays in `folder`.
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


def forget_progress(folder: Path) -> None:
    """Removes what the client keeps beside the files to go on with a download."""
    shutil.rmtree(folder / ".cache", ignore_errors=True)
