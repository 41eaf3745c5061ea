"""The change log of a data set, `CHANGELOG.md` in the form of Keep a Changelog."""

import re
from collections.abc import Iterable

from .difference import Change

_HEAD = """# Changelog
What changed in this data set, in the form of [Keep a Changelog](https://keepachangelog.com/en/1.1.0/).
A version is `major.minor.patch`: major when features, rate or existing frames changed or episodes went, minor when
episodes were added or excluded, patch when metadata or describing files were corrected.
"""
_SECTION = re.compile(r"^## \[(?P<version>[^\]]+)\]", re.MULTILINE)
_HEADINGS = {"removed": "Removed", "added": "Added"}


def with_release(text: str, version: str, date: str, notes: str, changes: Iterable[Change], content_hash: str) -> str:
    """A change log with one more release on top; `text` is empty for the first.

    Whatever stands under `[Unreleased]` stays there; a section of the same version, which a release that broke off
    left behind, is replaced.
    """
    sections = list(_SECTION.finditer(text))
    head = text[: sections[0].start()] if sections else (text or _HEAD)
    ends = [*(match.start() for match in sections[1:]), len(text)][: len(sections)]
    bodies = [(match["version"], text[match.start() : end]) for match, end in zip(sections, ends, strict=True)]
    unreleased = [body for name, body in bodies if name.lower() == "unreleased"]
    earlier = [body for name, body in bodies if name.lower() != "unreleased" and name != version]
    parts = [head, *unreleased, _section(version, date, notes, changes, content_hash), *earlier]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def _section(version: str, date: str, notes: str, changes: Iterable[Change], content_hash: str) -> str:
    groups: dict[str, list[str]] = {}
    for change in changes:
        word = next((word for word in _HEADINGS if f" {word}" in change.text), None)
        groups.setdefault(_HEADINGS.get(word or "", "Changed"), []).append(change.text)
    lines = [f"## [{version}] - {date}", "", notes, "", f"Content hash: `{content_hash}`"]
    for heading in ("Added", "Changed", "Removed"):
        if heading in groups:
            lines += ["", f"### {heading}", *(f"- {text}" for text in groups[heading])]
    return "\n".join(lines)
