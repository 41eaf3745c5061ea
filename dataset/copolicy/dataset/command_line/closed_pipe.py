"""Standard streams that take more than their reader wants, as in `copolicy-dataset check --rules | head -1`."""

import contextlib
import io
import sys
from collections.abc import Iterator
from typing import Any, TextIO


class _PipeEnd(io.FileIO):
    """A file descriptor that forgets what nobody reads any more."""

    def write(self, data: Any, /) -> int | None:
        try:
            return super().write(data)
        except BrokenPipeError:
            return memoryview(data).nbytes


@contextlib.contextmanager
def quiet_when_closed() -> Iterator[None]:
    """In this block a closed pipe behind stdout or stderr is no error: the command does its work to the end.

    Streams that are not those of the process, such as a test's, are left as they are.
    """
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = ours = tuple(map(_tolerant, before))
    try:
        yield
    finally:
        for stream, old in zip(ours, before, strict=True):
            if stream is not old and not stream.closed:
                stream.flush()
        sys.stdout, sys.stderr = before


def _tolerant(stream: TextIO) -> TextIO:
    if not isinstance(stream, io.TextIOWrapper):
        return stream
    if stream.errors in ("strict", "surrogateescape"):
        # A letter that the terminal's encoding lacks, or a file name of another one, is no reason to stop.
        stream.reconfigure(errors="backslashreplace")
    raw = getattr(stream.buffer, "raw", stream.buffer)  # without a buffer under `python -u`
    if type(raw) is not io.FileIO:
        return stream
    stream.flush()
    return io.TextIOWrapper(
        io.BufferedWriter(_PipeEnd(raw.fileno(), "w", closefd=False)),
        encoding=stream.encoding,
        errors=stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )
