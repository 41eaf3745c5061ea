"""Opens a data set given as a local folder or as a name on the Hub."""

from pathlib import Path

from ..exceptions import InvalidValueError
from ..files.local_path import require_repo_id
from ..files.meta_files import RAW_FOLDER
from ..publication.repo_id import checked_repo_id


def local_copy(path: str, revision: str | None = None, names: tuple[str, str] = ("path", "revision")) -> Path:
    """Returns an existing folder, or downloads a data set from the Hub (without its raw recordings).

    Args:
        path: a folder, `USER/NAME`, or `hf://datasets/USER/NAME`.
        revision: tag, branch or commit on the Hub; `main` if None.
        names: names of `path` and `revision` in error messages.

    Raises:
        FileFormatError: no such folder, and not a valid name on the Hub.
        InvalidValueError: a revision of a local folder, or of an invalid name.
        HubError: the Hub does not answer, or has no such data set or revision.
    """
    folder = Path(path)
    if folder.exists():
        if revision is not None:
            raise InvalidValueError(names[1], f"a data set on the Hub, {path} is a folder", revision)
        return folder
    if revision is not None and "://" not in path:
        return _download(checked_repo_id(path, names[0]), revision)
    return _download(require_repo_id(path, "a folder, or USER/NAME of a data set on the Hub"), revision)


def _download(repo_id: str, revision: str | None) -> Path:
    # Slow imports, not needed for a local folder.
    from .client import hub_errors, snapshot_download
    from .repository import resolve

    # By commit: for a branch or tag the client silently returns an older cached copy if the Hub does not answer.
    commit = resolve(repo_id, revision or "main")[1]
    with hub_errors(repo_id, "downloading"):
        # Raw recordings can be large.
        ignored = f"{RAW_FOLDER}/*"
        return Path(snapshot_download(repo_id, repo_type="dataset", revision=commit, ignore_patterns=ignored))
