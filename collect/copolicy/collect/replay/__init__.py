"""A recording again: in a window, as a film, a sheet of pictures, a check, or in Rerun."""
