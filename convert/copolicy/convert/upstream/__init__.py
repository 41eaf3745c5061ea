"""Imports files of the original program, in its three formats."""
