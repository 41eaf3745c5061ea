"""Summaries of the recordings in a folder, from which a session counts its episodes."""

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from copolicy.dataset.exceptions import FileFormatError, UnknownNameError
from copolicy.dataset.files.listing import broken_links, distinct_files
from copolicy.dataset.recording import episode_records
from copolicy.dataset.recording.reader import read_metadata
from copolicy.dataset.recording.verification import require_version
from copolicy.dataset.task import TABLE, get_task

PRACTICE = "practice"
"""Quality flag of a practice episode; it is marked discarded too."""

OFF_CENTRE = "stick_off_centre"
"""Quality flag of an episode with a stick that was off centre at rest; its event of the same name says whose."""


@dataclass(frozen=True)
class RecordingSummary:
    """The metadata of one recording that the schedule needs.

    Attributes:
        seating: 1 if player b sat on the robot seat, else 0.
        counts: the episode ran to its end and was kept, and was not practice.
        task: name of the task.
    """

    path: Path
    session_id: str
    map_id: str
    seating: int
    success: bool
    practice: bool
    counts: bool
    task: str = TABLE


def iter_recordings(folder: Path) -> Iterator[RecordingSummary]:
    """Yields the complete recordings in a folder and its subfolders, by path; logs and skips those it cannot read."""
    for link in broken_links(folder):
        if not link.match("*.mcap"):
            logging.warning("not counted: %s: a broken link", link)
    for path in distinct_files(folder, "*.mcap"):
        task = TABLE
        try:
            records = read_metadata(path)
            info = records.get("dataset_info", {})
            if episode_records.START_DIGEST in info:  # otherwise written by another program
                require_version(path, records)
            task = info.get("task", TABLE)
            result = records[episode_records.RESULT]
            players, flags = records["players"], result["quality_flags"].split(",")
            yield RecordingSummary(
                path,
                records["session"]["session_id"],
                records["episode"]["map_id"],
                int(players["player_0_id"] == f"{players['pair_id']}-b"),
                result["success"] == "true",
                PRACTICE in flags,
                result["discarded"] == "false"
                and PRACTICE not in flags
                and result["termination_reason"] in get_task(task).spec.reasons,
                task,
            )
        except UnknownNameError:
            logging.warning("not counted: %s: a recording of the task %r, which is not installed", path, task)
        except FileFormatError as error:
            logging.warning("not counted: %s", error)
        except KeyError as error:
            message = "not counted: %s: expected a recording of this task, found no metadata entry %s"
            logging.warning(message, path, error)
