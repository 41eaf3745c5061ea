"""Releases a data set folder: writes its record, manifest and change log (Keep a Changelog)."""

import datetime
import re
from collections.abc import Iterable
from pathlib import Path

from ..exceptions import InvalidValueError, RunError
from ..files.meta_files import CHANGELOG_FILE, CHECK_FILE, EARLIER_FOLDER, MANIFEST_FILE, RELEASE_FILE
from ..files.staging import replacements
from ..files.text_files import read_legacy_text
from ..publication.data_version import BUMPS, Bump, DataVersion
from .content import read_content
from .difference import Change, compare, withdrawal_text
from .digests import Content
from .manifest import FileEntry, Manifest, file_entry
from .release_record import ReleaseRecord, read_release
from .withdrawals import read_withdrawals

_CHANGELOG_HEAD = """# Changelog
What changed in this data set, in the form of [Keep a Changelog](https://keepachangelog.com/en/1.1.0/).
A version is `major.minor.patch`: major when features, rate or existing frames changed or episodes went, minor when
episodes were added or excluded, patch when metadata or describing files were corrected.
"""
_SECTION = re.compile(r"^## \[(?P<version>[^\]]+)\]", re.MULTILINE)
_HEADINGS = {"removed": "Removed", "added": "Added"}


def release(root: Path, bump: Bump, notes: str, date: datetime.date | None = None) -> ReleaseRecord:
    """Releases the present content of a folder as its next version: writes change log, record and manifest.

    The first release is a bump of 0.0.0. The record is written last: an interrupted release is not visible, and
    running it again completes it.

    Args:
        date: date of the release; today (UTC) by default.

    Raises:
        FileFormatError: no data set, or an inconsistent one.
        InvalidValueError: empty notes, or a bump smaller than the changes require.
        RunError: nothing changed since the last release.
    """
    notes = notes.strip()
    if not notes or any(line.startswith("## ") for line in notes.splitlines()):
        raise InvalidValueError("--notes", "a text without lines that begin with '## '", notes)
    content = read_content(root)
    manifest = Manifest.from_folder(root)
    files_sha256 = manifest.digest(without=_unhashed_files(manifest))
    last = read_release(root) if (root / RELEASE_FILE).exists() else None
    withdrawn = sum(entry["episodes"] for entry in read_withdrawals(root))
    changes = _changes(last, content, files_sha256, withdrawn)
    if last is not None:
        if not changes:
            raise RunError(f"{root}: expected a change since release {last.version}, found none; nothing was written")
        needed = max((change.bump for change in changes), key=BUMPS.index)
        if BUMPS.index(bump) < BUMPS.index(needed):
            reason = next(change.text for change in changes if change.bump == needed)
            raise InvalidValueError("--bump", f"{needed} or larger ({reason})", bump)
    version = str((last.data_version if last else DataVersion(0, 0, 0)).bumped(bump))
    day = (date or datetime.datetime.now(datetime.UTC).date()).isoformat()
    lines = [change.text for change in changes]
    record = ReleaseRecord(version, day, notes, lines, content.hash, files_sha256, content, withdrawn)
    _write(root, record, changes, last, manifest)
    return record


def _changes(last: ReleaseRecord | None, content: Content, files_sha256: str, withdrawn: int) -> tuple[Change, ...]:
    if last is None:
        frames = sum(episode.frames for episode in content.episodes)
        changes = (Change("minor", f"{len(content.episodes)} episodes added, {frames} frames"),)
        return (*changes, *_unreleased_withdrawals(withdrawn))
    difference = compare(last.content, content)
    # The last release may have contained only some of the episodes withdrawn since.
    changes = (*difference.changes, *_unreleased_withdrawals(withdrawn - last.withdrawn - len(difference.withdrawn)))
    if not changes and files_sha256 != last.files_sha256:
        return (Change("patch", "files changed beside the content (card, statistics, figures or layout)"),)
    return changes


def _unreleased_withdrawals(count: int) -> tuple[Change, ...]:
    return (Change("patch", f"{withdrawal_text(count)}; no release held them"),) if count > 0 else ()


def _unhashed_files(manifest: Manifest) -> set[str]:
    """Files written by a release itself, and the check findings, which every check rewrites."""
    earlier = {name for name in manifest.files if name.startswith(EARLIER_FOLDER + "/")}
    return {CHANGELOG_FILE, RELEASE_FILE, CHECK_FILE, *earlier}


def _write(
    root: Path, record: ReleaseRecord, changes: tuple[Change, ...], last: ReleaseRecord | None, manifest: Manifest
) -> None:
    changelog = root / CHANGELOG_FILE
    before = read_legacy_text(changelog) if changelog.exists() else ""
    texts: dict[str, str] = {}
    if last is not None:
        texts[f"{EARLIER_FOLDER}/{last.version}.json"] = last.to_text()
    texts[CHANGELOG_FILE] = changelog_with_release(
        before, record.version, record.date, record.notes, changes, record.content_hash
    )
    texts[RELEASE_FILE] = record.to_text()
    # The record comes last.
    names = [*sorted(texts, key=lambda name: name == RELEASE_FILE)]
    names.insert(-1, MANIFEST_FILE)
    entries: dict[str, FileEntry] = dict(manifest.files)
    with replacements([root / name for name in names]) as partials:
        staged = dict(zip(names, partials, strict=True))
        for name, text in texts.items():
            staged[name].write_text(text, encoding="utf-8")
            entries[name] = file_entry(staged[name])
        staged[MANIFEST_FILE].write_text(Manifest(entries).to_text(), encoding="utf-8")


def changelog_with_release(
    text: str, version: str, date: str, notes: str, changes: Iterable[Change], content_hash: str
) -> str:
    """Adds a release at the top of a change log; `text` is empty for the first release.

    A section `[Unreleased]` is kept above it; a section of the same version, left by an interrupted release, is
    replaced.
    """
    sections = list(_SECTION.finditer(text))
    head = text[: sections[0].start()] if sections else (text or _CHANGELOG_HEAD)
    ends = [*(match.start() for match in sections[1:]), len(text)][: len(sections)]
    bodies = [(match["version"], text[match.start() : end]) for match, end in zip(sections, ends, strict=True)]
    unreleased = [body for name, body in bodies if name.lower() == "unreleased"]
    earlier = [body for name, body in bodies if name.lower() != "unreleased" and name != version]
    parts = [head, *unreleased, _section(version, date, notes, changes, content_hash), *earlier]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def _section(version: str, date: str, notes: str, changes: Iterable[Change], content_hash: str) -> str:
    groups: dict[str, list[str]] = {}
    for change in changes:
        keyword = next((keyword for keyword in _HEADINGS if f" {keyword}" in change.text), None)
        groups.setdefault(_HEADINGS.get(keyword or "", "Changed"), []).append(change.text)
    lines = [f"## [{version}] - {date}", "", notes, "", f"Content hash: `{content_hash}`"]
    for heading in ("Added", "Changed", "Removed"):
        if heading in groups:
            lines += ["", f"### {heading}", *(f"- {text}" for text in groups[heading])]
    return "\n".join(lines)
