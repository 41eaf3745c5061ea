"""In which order things reach the disk and get their names."""

import os
from pathlib import Path

import pytest


def record_disk_order(patch: pytest.MonkeyPatch) -> list[int | Path]:
    """A list that grows with each file or folder that is synced, by inode, and each name that one is renamed to."""
    happened: list[int | Path] = []
    fsync, rename, replace = os.fsync, Path.rename, os.replace

    def synced(descriptor: int) -> None:
        happened.append(os.fstat(descriptor).st_ino)
        fsync(descriptor)

    def renamed(self: Path, target: Path) -> Path:
        happened.append(Path(target))
        return rename(self, target)

    def replaced(source: Path, target: Path) -> None:
        happened.append(Path(target))
        replace(source, target)

    patch.setattr(os, "fsync", synced)
    patch.setattr(os, "replace", replaced)
    patch.setattr(Path, "rename", renamed)
    return happened


def inodes(*paths: Path) -> set[int]:
    return {path.stat().st_ino for path in paths}
