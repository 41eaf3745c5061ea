"""A data set that is named by a folder or by its name on the Hub, as a folder here."""

from pathlib import Path

from ..exceptions import InvalidValueError
from ..files.local_path import require_hub_name
from ..files.meta_files import RAW_FOLDER
from ..publication.repo_id import checked_repo_id


def local_copy(path: str, revision: str | None = None, names: tuple[str, str] = ("path", "revision")) -> Path:
    """The folder itself if it exists, else everything but the recordings of a data set on the Hub, downloaded.

    Args:
        path: a folder, `USER/NAME`, or `hf://datasets/USER/NAME`.
        revision: tag, branch or commit on the Hub; `main` if None.
        names: what an error calls the two.

    Raises:
        FileFormatError: no such folder, and no name on the Hub.
        InvalidValueError: a revision of a folder, or one of no name.
        HubError: the Hub does not answer, or has no such data set or revision.
        MissingExtraError: the Hub's client is not installed.
    """
    folder = Path(path)
    if folder.exists():
        if revision is not None:
            raise InvalidValueError(names[1], f"a data set on the Hub, {path} is a folder", revision)
        return folder
    if revision is not None and "://" not in path:
        return _downloaded(checked_repo_id(path, names[0]), revision)
    return _downloaded(require_hub_name(path, "a folder, or USER/NAME of a data set on the Hub"), revision)


def _downloaded(repo_id: str, revision: str | None) -> Path:
    # Heavy packages, which a folder here need not wait for.
    from .client import hub_errors, snapshot_download
    from .repository import resolve

    # By its commit: asked for a branch or tag while the Hub is away, the client takes an older copy and says nothing.
    commit = resolve(repo_id, revision or "main")[1]
    with hub_errors(repo_id, "downloading"):
        # Recordings beside the tables and metadata can be large.
        skipped = f"{RAW_FOLDER}/*"
        return Path(snapshot_download(repo_id, repo_type="dataset", revision=commit, ignore_patterns=skipped))
