"""A pair's session: what comes next, what was played, and the folder that remembers it."""

from .balance import Balance, Counts
from .folder import CollectionLock, SessionFolder
from .recorded import PRACTICE, Recorded, recordings

__all__ = ["PRACTICE", "Balance", "CollectionLock", "Counts", "Recorded", "SessionFolder", "recordings"]
