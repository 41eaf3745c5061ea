"""Converts thousands of recordings in restartable shards, with datatrove: locally, on SLURM or on Ray."""
