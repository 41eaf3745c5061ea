"""A disk that takes no more, by a limit on the size of a file."""

import contextlib
import os
import sys

import pytest

resource = pytest.importorskip("resource", reason="limits of a process are POSIX")


@contextlib.contextmanager
def full_disk(limit: int):
    """No file may grow beyond `limit` bytes; Python ignores the signal that the system would send.

    Nothing is compiled meanwhile, here or in processes that are started: Python takes what fits for a whole `.pyc`, and
    whoever imports that module next finds `marshal data too short`.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "dont_write_bytecode", True)
        patch.setitem(os.environ, "PYTHONDONTWRITEBYTECODE", "1")
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
