"""Where the data are: a folder here, or a data set on the Hub that is brought here first."""

import re
from pathlib import Path

from ..exceptions import FileFormatError, InvalidValueError, MissingExtraError, RunError

_HUB_ID = re.compile(r"[A-Za-z0-9][\w.-]*/[A-Za-z0-9][\w.-]*")


def locate(path: str, revision: str | None = None) -> Path:
    """The folder behind a PATH: itself if it exists, else the data set `USER/NAME` of the Hub, downloaded.

    Raises:
        FileFormatError: nothing there, and no name of the Hub either.
        InvalidValueError: a revision of a folder.
        RunError: the Hub has no such data set or cannot be reached.
        MissingExtraError: huggingface_hub is not installed.
    """
    folder = Path(path)
    if folder.exists():
        if revision is not None:
            raise InvalidValueError("--revision", f"a data set on the Hub, {path} is a folder", revision)
        return folder
    if not _HUB_ID.fullmatch(path):
        raise FileFormatError(path, "a folder, or USER/NAME of a data set on the Hub", "neither")
    return _download(path, revision)


def _download(repo_id: str, revision: str | None) -> Path:
    try:
        from huggingface_hub import snapshot_download
        from huggingface_hub.errors import HfHubHTTPError, LocalEntryNotFoundError
    except ModuleNotFoundError:
        raise MissingExtraError("huggingface_hub") from None
    try:
        # The checks read tables and metadata; a copy of the recordings beside them can be large.
        return Path(snapshot_download(repo_id, repo_type="dataset", revision=revision, ignore_patterns=["raw/*"]))
    except (HfHubHTTPError, LocalEntryNotFoundError) as error:
        found = str(error).strip().splitlines()[0]
        raise RunError(f"{repo_id}: expected a folder or a data set on the Hub, found neither: {found}") from None
    except OSError as error:
        raise RunError(f"{repo_id}: expected a data set on the Hub, could not reach it: {error}") from None
