"""The files of a policy's processors beside its weights, which change its actions as the weights do."""

import hashlib
from pathlib import Path


def processors_sha256(checkpoint: Path) -> str:
    """sha256 of the names and contents of the files of a policy's processors: their steps and statistics."""
    files = sorted(path for path in checkpoint.glob("policy_*processor*") if path.is_file())
    listed = "".join(f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n" for path in files)
    return hashlib.sha256(listed.encode()).hexdigest()
