"""Where the data are: a folder here, or a data set on the Hub that is brought here first."""

from pathlib import Path

from ..exceptions import InvalidValueError
from ..files.local_path import require_hub_name
from ..publication.repo_id import checked_repo_id


def locate(path: str, revision: str | None = None) -> Path:
    """The folder behind a PATH: itself if it exists, else the data set `USER/NAME` of the Hub, downloaded.

    Args:
        revision: tag, branch or commit on the Hub; says that PATH is a name there.

    Raises:
        FileFormatError: a path that does not exist, or no name of the Hub.
        InvalidValueError: a revision of a folder, or of what is no name of the Hub.
        HubError: the Hub does not answer, or has no such revision.
        RunError: the Hub has no such data set.
        MissingExtraError: huggingface_hub is not installed.
    """
    folder = Path(path)
    if folder.exists():
        if revision is not None:
            raise InvalidValueError("--revision", f"a data set on the Hub, {path} is a folder", revision)
        return folder
    if revision is not None and "://" not in path:
        return _download(checked_repo_id(path, "PATH"), revision)
    return _download(require_hub_name(path, "a folder, or USER/NAME of a data set on the Hub"), revision)


def _download(repo_id: str, revision: str | None) -> Path:
    # Heavy packages, which a folder here need not wait for.
    from ..hub.client import hub_errors, snapshot_download
    from ..hub.download import resolve
    from ..hub.raw_recordings import RAW_FOLDER

    # By its commit: asked for a branch or tag while the Hub is away, the client takes an older copy and says nothing.
    commit = resolve(repo_id, revision or "main")[1]
    with hub_errors(repo_id, "downloading"):
        # The checks read tables and metadata; a copy of the recordings beside them can be large.
        skipped = f"{RAW_FOLDER}/*"
        return Path(snapshot_download(repo_id, repo_type="dataset", revision=commit, ignore_patterns=skipped))
