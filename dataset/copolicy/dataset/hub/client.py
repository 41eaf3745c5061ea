"""The Hub's client and one-line messages for its errors."""

import contextlib
import logging
from collections.abc import Iterator

import httpx
from huggingface_hub import CommitOperationAdd, CommitOperationDelete, HfApi, get_token, snapshot_download
from huggingface_hub.errors import (
    HfHubHTTPError,
    LocalTokenNotFoundError,
    OfflineModeIsEnabled,
    RemoteEntryNotFoundError,
    RepositoryNotFoundError,
)

from ..exceptions import CopolicyError, RunError
from ..files.staging import disk_error_number, error_chain

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

# httpx logs every request at INFO, the level that the commands show.
logging.getLogger("httpx").setLevel(logging.WARNING)
# A failed write of this cache only slows the next download; a full disk raises its own error.
logging.getLogger("huggingface_hub._tree_cache").setLevel(logging.ERROR)

_STATUS_MESSAGES = {
    401: "the Hub rejected the token, or a private data set needs one; set HF_TOKEN or run `hf auth login`",
    403: "the token has no write access to the repository",
    404: "no such data set on the Hub, or a private one that the token cannot read",
    409: "the repository was changed by another commit; check the changes and run the command again",
    412: "the repository was changed by another commit; check the changes and run the command again",
    413: "the request is too large for the Hub",
    429: "too many requests to the Hub; run the command again later",
}


class HubError(RunError):
    """A request to the Hub failed."""


def hub_api() -> HfApi:
    """A client with the user's token (`HF_TOKEN`, or the one that `hf auth login` stored)."""
    return HfApi(library_name="copolicy")


@contextlib.contextmanager
def hub_errors(repo_id: str, action: str) -> Iterator[None]:
    """Turns an error of the client into a one-line `HubError` that never contains the token.

    Errors of a full or read-only disk pass through unchanged.

    Args:
        action: what the block does, such as `uploading`.
    """
    try:
        yield
    except CopolicyError:
        raise
    except (OSError, ValueError, RuntimeError, httpx.HTTPError) as error:
        if disk_error_number(error) is not None:
            raise
        raise HubError(_without_token(f"{repo_id}: {action}: {_error_message(error)}")) from None


def _error_message(error: BaseException) -> str:
    """The message of the first error in the chain with a known cause; the client wraps transfer errors in others."""
    chain = list(error_chain(error))
    for cause in chain:
        if isinstance(cause, OfflineModeIsEnabled):
            return "the Hub's client is offline (HF_HUB_OFFLINE is set)"
        if isinstance(cause, LocalTokenNotFoundError):
            return _STATUS_MESSAGES[401]
        if isinstance(cause, HfHubHTTPError):
            status = cause.response.status_code
            if cause.response.headers.get("X-Error-Code") == "RevisionNotFound":
                return "no such revision"
            if status >= 500:
                return f"the Hub failed (HTTP {status}); run the command again to continue"
            return _STATUS_MESSAGES.get(status) or f"HTTP {status}: {cause.server_message or _first_line(cause)}"
    for cause in chain:
        if isinstance(cause, httpx.TransportError):
            reason = _first_line(cause) or type(cause).__name__
            return f"the connection was lost ({reason}); run the command again to continue"
    return _first_line(error) or type(error).__name__


def _first_line(error: BaseException) -> str:
    return next((line.strip() for line in str(error).splitlines() if line.strip()), "")


def _without_token(text: str) -> str:
    token = get_token()
    return text.replace(token, "***") if token else text
