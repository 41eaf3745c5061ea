"""Names of files from names of robots, partners and methods, and names given to paths on the command line."""

import re
import zlib
from collections.abc import Iterable
from pathlib import Path


def file_name(name: str) -> str:
    """A name with only characters that every file system accepts, at most 60 of them; other names can give the same."""
    return re.sub(r"[^A-Za-z0-9._=-]+", "_", name)[:60]


def split_name(text: str) -> tuple[str, str]:
    """Splits `NAME=PATH`; the name is empty if there is none (a path may contain `=` after a slash)."""
    name, sign, path = text.partition("=")
    return (name, path) if sign and "/" not in name and not Path(text).exists() else ("", text)


def file_names(names: Iterable[str]) -> dict[str, str]:
    """`file_name` of each name; where several give the same, each has a check sum of the name added."""
    names = list(names)
    plain = [file_name(name) for name in names]
    return {
        name: text if plain.count(text) == 1 else f"{text}-{zlib.crc32(name.encode()):08x}"
        for name, text in zip(names, plain, strict=True)
    }
