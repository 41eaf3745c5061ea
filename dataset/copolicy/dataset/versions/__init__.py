"""Versions of a data set: what it holds as one hash, releases of it, and what differs between two."""
