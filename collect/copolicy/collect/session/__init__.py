"""A pair's session: what comes next, what was played, and the folder that remembers it."""

from .balance import Balance, Counts
from .folder import CollectionLock, SessionFolder
from .recorded import OFF_CENTRE, PRACTICE, Recorded, recordings

__all__ = ["OFF_CENTRE", "PRACTICE", "Balance", "CollectionLock", "Counts", "Recorded", "SessionFolder", "recordings"]
