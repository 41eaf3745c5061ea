"""Restartable tasks in processes of this machine, as SLURM jobs or on Ray, with datatrove's executors (extra `scale`).

Imports nothing: a command that runs in one process must not load datatrove.
"""
