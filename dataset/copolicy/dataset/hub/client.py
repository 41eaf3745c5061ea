"""The Hub's client, and what its errors mean in one line."""

import contextlib
import logging
from collections.abc import Iterator

from ..exceptions import CopolicyError, MissingExtraError, RunError
from ..files.staging import causes, refusal

try:
    import httpx
    from huggingface_hub import CommitOperationAdd, CommitOperationDelete, HfApi, get_token, snapshot_download
    from huggingface_hub.errors import (
        HfHubHTTPError,
        LocalTokenNotFoundError,
        OfflineModeIsEnabled,
        RemoteEntryNotFoundError,
        RepositoryNotFoundError,
    )
except ModuleNotFoundError as error:
    raise MissingExtraError((error.name or "huggingface_hub").split(".")[0]) from None

__all__ = [
    "CommitOperationAdd",
    "CommitOperationDelete",
    "HfApi",
    "HubError",
    "RemoteEntryNotFoundError",
    "RepositoryNotFoundError",
    "hub_api",
    "hub_errors",
    "snapshot_download",
]

# The client tells of every request at the level that our commands show.
logging.getLogger("httpx").setLevel(logging.WARNING)
# It warns where it cannot keep a list that only speeds up the next download; a full disk says so itself.
logging.getLogger("huggingface_hub._tree_cache").setLevel(logging.ERROR)

_MEANINGS = {
    401: "the Hub does not accept the token, or a private data set needs one; set HF_TOKEN or run `hf auth login`",
    403: "the token may not do this; it needs the right to write to the repository",
    404: "no such data set on the Hub, or a private one that the token may not see",
    409: "somebody else committed meanwhile; look at what changed there and run the command again",
    412: "somebody else committed meanwhile; look at what changed there and run the command again",
    413: "the Hub finds the request too large",
    429: "the Hub asks to wait; run the command again later",
}


class HubError(RunError):
    """The Hub did not do what was asked."""


def hub_api() -> HfApi:
    """A client with the token of the environment (`HF_TOKEN`, or what `hf auth login` stored)."""
    return HfApi(library_name="copolicy")


@contextlib.contextmanager
def hub_errors(repo_id: str, doing: str) -> Iterator[None]:
    """Turns an error of the client into a `HubError` of one line that never holds the token.

    An error of a disk that is full or takes no more passes through: it is not the Hub's.

    Args:
        doing: what is going on, such as `uploading`.
    """
    try:
        yield
    except CopolicyError:
        raise
    except (OSError, ValueError, RuntimeError, httpx.HTTPError) as error:
        if refusal(error) is not None:
            raise
        raise HubError(_without_token(f"{repo_id}: {doing}: {_meaning(error)}")) from None


def _meaning(error: BaseException) -> str:
    """The innermost cause that says something; the client wraps errors of uploads and downloads in others."""
    chain = list(causes(error))
    for cause in chain:
        if isinstance(cause, OfflineModeIsEnabled):
            return "the Hub's client is offline (HF_HUB_OFFLINE is set)"
        if isinstance(cause, LocalTokenNotFoundError):
            return _MEANINGS[401]
        if isinstance(cause, HfHubHTTPError):
            status = cause.response.status_code
            if cause.response.headers.get("X-Error-Code") == "RevisionNotFound":
                return "no such revision"
            if status >= 500:
                return f"the Hub has trouble (HTTP {status}); run the command again, it goes on where it stopped"
            return _MEANINGS.get(status) or f"HTTP {status}: {cause.server_message or _first_line(cause)}"
    for cause in chain:
        if isinstance(cause, httpx.TransportError):
            reason = _first_line(cause) or type(cause).__name__
            return f"the connection broke off ({reason}); run the command again, it goes on where it stopped"
    return _first_line(error) or type(error).__name__


def _first_line(error: BaseException) -> str:
    return next((line.strip() for line in str(error).splitlines() if line.strip()), "")


def _without_token(text: str) -> str:
    token = get_token()
    return text.replace(token, "***") if token else text
