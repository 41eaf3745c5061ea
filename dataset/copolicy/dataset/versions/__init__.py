"""Versions of a data set: its content hash, releases, and the differences between two versions."""
