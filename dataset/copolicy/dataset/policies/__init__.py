"""The files of a trained policy, read without torch."""
