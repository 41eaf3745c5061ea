"""A recording again: in a window, as a film, a sheet of pictures, a check, or in Rerun."""

from .track import Track, read_track

__all__ = ["Track", "read_track"]
