"""Deletes the episodes of a consent id from recordings, data sets and records of releases."""
