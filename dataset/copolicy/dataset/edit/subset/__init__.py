"""Reads a stored data set and writes some of its episodes as a new data set."""
