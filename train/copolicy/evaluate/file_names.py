"""Names of files from names of robots, partners and methods."""

import re


def file_name(name: str) -> str:
    """A name with only characters that every file system accepts, at most 60 of them; other names can give the same."""
    return re.sub(r"[^A-Za-z0-9._=-]+", "_", name)[:60]
