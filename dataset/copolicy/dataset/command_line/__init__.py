"""Shared parts of all commands: parsers, output, exit status, numeric flags."""
