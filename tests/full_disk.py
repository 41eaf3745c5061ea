"""A disk that takes no more, by a limit on the size of a file."""

import contextlib

import pytest

resource = pytest.importorskip("resource", reason="limits of a process are POSIX")


@contextlib.contextmanager
def full_disk(limit: int):
    """No file may grow beyond `limit` bytes; Python ignores the signal that the system would send."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
