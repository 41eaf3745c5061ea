"""Permissions of files for root, who may read and write anything unless it gives these rights up."""

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

_VERSION = 0x20080522  # of the Linux calls below, with two words of each set of rights
_DAC_OVERRIDE, _DAC_READ_SEARCH = 1, 2  # capabilities(7)


class _Header(ctypes.Structure):
    _fields_ = (("version", ctypes.c_uint32), ("pid", ctypes.c_int))


class _Rights(ctypes.Structure):
    _fields_ = (("effective", ctypes.c_uint32), ("permitted", ctypes.c_uint32), ("inheritable", ctypes.c_uint32))


@contextmanager
def permissions_apply() -> Iterator[None]:
    """This thread may do no more with a file than its permissions say; skips a test where root cannot arrange that."""
    if os.geteuid() != 0:
        yield
        return
    if not sys.platform.startswith("linux"):
        pytest.skip("root may read every file")
    library, header, rights = ctypes.CDLL(None, use_errno=True), _Header(_VERSION, 0), (_Rights * 2)()
    if library.capget(ctypes.byref(header), rights):
        pytest.skip(f"root may read every file: {os.strerror(ctypes.get_errno())}")
    before = rights[0].effective
    rights[0].effective &= ~(1 << _DAC_OVERRIDE | 1 << _DAC_READ_SEARCH)
    assert not library.capset(ctypes.byref(header), rights), os.strerror(ctypes.get_errno())
    try:
        yield
    finally:
        rights[0].effective = before
        assert not library.capset(ctypes.byref(header), rights), os.strerror(ctypes.get_errno())
