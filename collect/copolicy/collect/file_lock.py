"""Marks a file as one that a living process works on."""

from typing import BinaryIO

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None


def hold(file: BinaryIO, wait: bool = False) -> bool:
    """Takes the lock of an open file; the system lets go of it when the file is closed or its process ends, however.

    The lock stops nobody from reading the file: it only tells a holder apart from what a crash left behind.

    Args:
        file: open for writing, which a network file system asks for.
        wait: until another process lets go.

    Returns:
        False where another process holds it. True where it was taken, and on systems that know no such lock
        (Windows, some network folders), where nothing can be told.
    """
    if fcntl is None:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True
