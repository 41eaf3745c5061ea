"""The name of a data set on the Hub."""

import re

from copolicy.dataset.exceptions import InvalidValueError


def checked_repo_id(text: str) -> str:
    """The name as it was given.

    Raises:
        InvalidValueError: it is not USER/NAME.
    """
    if not re.fullmatch(r"[\w.-]+/[\w.-]+", text):
        raise InvalidValueError("--repo-id", "USER/NAME", text)
    return text
