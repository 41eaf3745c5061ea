"""`withdraw`: deletes the episodes of a consent id from recordings, data sets, raw copies and records of releases."""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ...exceptions import InvalidValueError, RunError
from .data_set import deleted_with, describe, remove_withdrawn
from .recordings import delete_recordings, hard_links, planned_removal
from .scope import WithdrawalScope, find_scope

COPIES_ELSEWHERE = (
    "copies elsewhere: backups, exports (zarr, robomimic, minari), checkpoints trained on the episodes, caches of "
    "LeRobot and the Hub's client (~/.cache/huggingface), and what others have downloaded"
)
ON_THE_HUB = (
    "earlier commits keep the episodes: release and publish the data set, delete the tags of earlier releases "
    "(HfApi().delete_tag), then HfApi().super_squash_history(REPO, repo_type='dataset'); or delete the repository "
    "(HfApi().delete_repo)"
)


def withdraw(consent: str, paths: Sequence[Path], delete: bool = False) -> dict[str, Any]:
    """Deletes all episodes of a consent id below some paths, in recordings and data sets with their raw copies.

    An episode with the consent id in one place is deleted from all places, even from copies without the id (an id
    amended in a data set is not in its recordings). A data set is replaced atomically; it records the date and number
    of withdrawn episodes, not which.

    Args:
        consent: one id; an episode with several ids is deleted for any of them.
        paths: folders with recordings or data sets, searched recursively, or single recordings.
        delete: delete the episodes; by default they are only listed.

    Returns:
        Summary.

    Raises:
        InvalidValueError: not a single consent id.
        FileFormatError: a path does not exist, or a data set below it cannot be read; nothing was changed.
        RunError: no episode has the consent id.
    """
    consent = consent.strip()
    if not consent or "," in consent:
        raise InvalidValueError("CONSENT_ID", "one consent id", consent)
    scope = find_scope(consent, paths)
    if not scope.sets and not scope.recordings:
        shown = ", ".join(map(str, paths))
        unread = f" ({len(scope.unreadable)} recordings cannot be read)" if scope.unreadable else ""
        raise RunError(f"{shown}: expected an episode with consent id {consent}, found none{unread}")
    summary: dict[str, Any] = {
        "withdrawn" if delete else "would_be_withdrawn": scope.episodes,
        "recordings": len(scope.recordings),
        "data_sets": {},
    }
    deleted = {path for data_set in scope.sets for path in deleted_with(data_set)}
    linked = [str(recording.path) for recording in scope.recordings if hard_links(recording.path)]
    other_files: list[Path] = []
    # Copies without the consent id first: after an interruption those with the id still lead to the rest.
    for direct in (False, True):
        for data_set in (part for part in scope.sets if (part.root in scope.direct) is direct):
            facts = describe(data_set)
            if delete:
                facts |= remove_withdrawn(data_set, scope.traces, len(data_set.numbers))
            summary["data_sets"][str(data_set.root)] = facts
        if delete:
            files = [recording.path for recording in scope.recordings if (recording.path in scope.direct) is direct]
            other_files += delete_recordings(files, scope.traces)
    if delete:
        reports = {
            "still_named_in": [str(path) for path in _files_with_names(paths, scope)],
            "beside_deleted_recordings": [str(path) for path in other_files if os.path.lexists(path)],
            "next": "copolicy-dataset release ROOT --bump major, then publish",
        }
    else:
        reports = {**_planned(scope), "next": "nothing was changed; --yes deletes"}
    reports |= {
        "hard_links_elsewhere": linked,
        "git_history": [str(part.root) for part in scope.sets if (part.root / ".git").exists()],
        "of_other_projects": [str(path) for path in scope.foreign],
        "unfinished": [str(path) for path in scope.unfinished if path.exists() and path.resolve() not in deleted],
        "unreadable": [str(path) for path in scope.unreadable],
        "on_the_hub": ON_THE_HUB,
        "out_of_reach": COPIES_ELSEWHERE,
    }
    summary |= {name: value for name, value in reports.items() if value}
    return summary | ({"exit_status": 1} if scope.unreadable else {})


def _planned(scope: WithdrawalScope) -> dict[str, Any]:
    """Files and folders that would be deleted, and numbers of lines that would be removed from other files."""
    removal = planned_removal([recording.path for recording in scope.recordings], scope.traces)
    paths = [*removal.recordings, *removal.session_files, *removal.folders]
    paths += [path for data_set in scope.sets for path in deleted_with(data_set)]
    return {
        "files": [str(path) for path in dict.fromkeys(paths)],
        "lines": {str(path): f"{removed} of {total}" for path, (removed, total) in removal.lines.items()},
    }


def _files_with_names(paths: Sequence[Path], scope: WithdrawalScope) -> Iterator[Path]:
    """Yields text files outside data sets that still contain a removed name; they are not changed."""
    roots = [data_set.root.resolve() for data_set in scope.sets]
    for path in paths:
        if path.is_dir():
            for file in scope.traces.matching_files(path):
                if not any(file.resolve().is_relative_to(root) for root in roots):
                    yield file
