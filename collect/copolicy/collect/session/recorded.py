"""What the recordings of a folder say about themselves: the only memory that a session trusts."""

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
"""Quality flag of an episode to try things out; it is marked discarded too."""

OFF_CENTRE = "stick_off_centre"
"""Quality flag of an episode with a stick that pushed while nobody touched it; the event of it says whose."""


@dataclass(frozen=True)
class Recorded:
    """One recording, as far as the schedule needs it.

    Attributes:
        counts: it was played to its end and kept, and was no practice.
        seating: 1 where player b sat on the robot's seat.
        task: its name.
    """

    path: Path
    session_id: str
    map_id: str
    seating: int
    success: bool
    practice: bool
    counts: bool
    task: str = TABLE


def recordings(folder: Path) -> Iterator[Recorded]:
    """The complete recordings in a folder and all below it, by path; one that cannot be read is told and left out."""
    for link in broken_links(folder):
        if not link.match("*.mcap"):
            logging.warning("not counted: %s: a link that leads nowhere", link)
    for path in distinct_files(folder, "*.mcap"):
        task = TABLE
        try:
            records = read_metadata(path)
            info = records.get("dataset_info", {})
            if episode_records.START_DIGEST in info:  # else it is not ours
                require_version(path, records)
            task = info.get("task", TABLE)
            result = records[episode_records.RESULT]
            players, flags = records["players"], result["quality_flags"].split(",")
            yield Recorded(
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
