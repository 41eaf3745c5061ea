"""Reads the files of a trained policy without torch."""
