"""Thousands of recordings in shards, each restartable, run by datatrove here, on SLURM or on Ray.

`command.convert_in_shards` does it; this file imports nothing, so that a conversion without shards stays quick.
"""
