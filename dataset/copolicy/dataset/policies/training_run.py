"""Where the newest checkpoint of a training run lies, also of a run that was copied without links."""

from collections.abc import Iterator, Sequence
from pathlib import Path

POLICY_FILES = ("config.json", "model.safetensors")
"""What a folder holds that a policy can be loaded from."""

_CHECKPOINTS, _LAST, _POLICY = "checkpoints", "last", "pretrained_model"


def find_policy_folder(path: Path, files: Sequence[str] = POLICY_FILES) -> Path | None:
    """The folder of a policy: `path` itself, one that holds `pretrained_model`, or the newest checkpoint of a run.

    The newest is what the link `checkpoints/last` leads to, else the checkpoint of the highest number: a copy without
    links has no `last`, or a broken one, a text file or a folder of that name instead. `path` may be the run, its
    `checkpoints`, or a path through a `last` that is not there.

    Args:
        path: what the user named.
        files: names that the folder must hold.

    Returns:
        None where there is none.
    """
    for folder in _candidates(path):
        if all((folder / name).is_file() for name in files):
            return folder
    return None


def _candidates(path: Path) -> Iterator[Path]:
    through_last = path if path.name == _LAST else path.parent
    # A `last` that is no link is a copy, which a run that went on has left behind.
    if through_last.name == _LAST and through_last.parent.name == _CHECKPOINTS and not through_last.is_symlink():
        yield from _of_run(through_last.parent)
    yield path
    yield path / _POLICY
    yield from _of_run(path / _CHECKPOINTS)
    if path.name == _CHECKPOINTS:
        yield from _of_run(path)
    if through_last.name == _LAST and through_last.parent.name == _CHECKPOINTS:
        yield from _of_run(through_last.parent)


def _of_run(checkpoints: Path) -> Iterator[Path]:
    last = checkpoints / _LAST
    if last.is_symlink():
        yield last / _POLICY
    if checkpoints.is_dir():
        numbered = [folder for folder in checkpoints.iterdir() if folder.name.isdecimal() and folder.is_dir()]
        for folder in sorted(numbered, key=lambda folder: int(folder.name), reverse=True):
            yield folder / _POLICY
    yield last / _POLICY
