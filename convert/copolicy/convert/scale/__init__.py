"""Converts thousands of recordings in restartable shards, with datatrove: locally, on SLURM or on Ray.

Imports nothing: a conversion without shards must not load datatrove.
"""
