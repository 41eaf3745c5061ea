"""A pair's session: the schedule of its episodes, its folder, and the recordings that count."""

from .folder import CollectionLock, SessionFolder
from .recording_summaries import OFF_CENTRE, PRACTICE, iter_recordings
from .schedule import BalancedSchedule, EpisodeCounts

__all__ = [
    "OFF_CENTRE", "PRACTICE", "BalancedSchedule", "CollectionLock", "EpisodeCounts", "SessionFolder", "iter_recordings",
]  # fmt: skip
