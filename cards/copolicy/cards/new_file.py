"""Files that are not overwritten unless asked."""

from pathlib import Path

from copolicy.dataset.exceptions import OutputExistsError


def require_new(path: Path, overwrite: bool) -> None:
    """Checks that nothing would be overwritten that should not be.

    Raises:
        OutputExistsError: there is something at `path` and `overwrite` is off.
    """
    if path.exists() and not overwrite:
        raise OutputExistsError(path)
