"""Finds the newest checkpoint of a training run, even if the run was copied without links."""

from collections.abc import Iterator, Sequence
from pathlib import Path

POLICY_FILES = ("config.json", "model.safetensors")
"""Files in a folder that a policy can be loaded from."""

PLACE_SETTINGS = (
    "device", "license", "physics_mixture", "pretrained_path", "pretrained_revision", "private", "push_to_hub",
    "repo_id", "tags", "unseen",
)  # fmt: skip
"""Entries of `config.json` that say where a policy was trained and kept, not which it is."""

_CHECKPOINTS, _LAST, _POLICY = "checkpoints", "last", "pretrained_model"


def find_policy_folder(path: Path, files: Sequence[str] = POLICY_FILES) -> Path | None:
    """Finds the folder of a policy: `path` itself, `pretrained_model` in it, or the newest checkpoint of a run.

    The newest checkpoint is the target of the link `checkpoints/last`, else the one of the highest number: in a copy
    without links `last` is missing, broken, a text file or a folder. `path` may be the run, its folder `checkpoints`,
    or a path through a missing `last`.

    Args:
        path: path given by the user.
        files: names of files that the folder must contain.

    Returns:
        The folder, or None if there is none.
    """
    for folder in _candidate_folders(path):
        if all((folder / name).is_file() for name in files):
            return folder
    return None


def _candidate_folders(path: Path) -> Iterator[Path]:
    through_last = path if path.name == _LAST else path.parent
    # A `last` that is not a link is a copy, which is outdated if the run was resumed.
    if through_last.name == _LAST and through_last.parent.name == _CHECKPOINTS and not through_last.is_symlink():
        yield from _checkpoints_of_run(through_last.parent)
    yield path
    yield path / _POLICY
    yield from _checkpoints_of_run(path / _CHECKPOINTS)
    if path.name == _CHECKPOINTS:
        yield from _checkpoints_of_run(path)
    if through_last.name == _LAST and through_last.parent.name == _CHECKPOINTS:
        yield from _checkpoints_of_run(through_last.parent)


def _checkpoints_of_run(checkpoints: Path) -> Iterator[Path]:
    last = checkpoints / _LAST
    if last.is_symlink():
        yield last / _POLICY
    if checkpoints.is_dir():
        numbered = [folder for folder in checkpoints.iterdir() if folder.name.isdecimal() and folder.is_dir()]
        for folder in sorted(numbered, key=lambda folder: int(folder.name), reverse=True):
            yield folder / _POLICY
    yield last / _POLICY
