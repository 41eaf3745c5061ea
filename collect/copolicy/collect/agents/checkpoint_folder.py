"""Where a policy lies on the disk: in a checkpoint, in a training run, or beside LeRobot's plugin of this package."""

from importlib.util import find_spec
from pathlib import Path

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.listing import is_hidden
from copolicy.dataset.policies.training_run import POLICY_FILES, find_policy_folder

PRETRAINED = "pretrained"
"""In the place of a path: the model that comes with the package."""

_PLUGIN = "lerobot_policy_copolicy"


def checkpoint_folder(path: Path | str) -> Path:
    """The folder with `config.json` and `model.safetensors`.

    Args:
        path: that folder, one that holds `pretrained_model`, that of a training run (its newest checkpoint, see
            `find_policy_folder`), or `pretrained`.

    Raises:
        FileFormatError: there is none.
    """
    if str(path) == PRETRAINED:
        return pretrained_folder()
    path = Path(path)
    folder = find_policy_folder(path)
    if folder is not None:
        return folder
    expected = f"a checkpoint folder with {' and '.join(POLICY_FILES)}"
    raise FileFormatError(path, expected, _found(path) or "an empty folder")


def pretrained_folder() -> Path:
    """The folder of the model that comes with the package.

    The plugin is found by its name, as LeRobot finds it, and not imported: that takes LeRobot, a path does not.

    Raises:
        FileFormatError: this installation lacks the plugin or its model.
    """
    spec = find_spec(_PLUGIN)
    places = list((spec and spec.submodule_search_locations) or ())
    if not places:
        raise FileFormatError(PRETRAINED, f"the package {_PLUGIN} with its model", "no such package")
    folder = Path(places[0]) / PRETRAINED
    missing = [name for name in POLICY_FILES if not (folder / name).is_file()]
    if missing:
        found = f"none named {' and '.join(missing)}; reinstall {_PLUGIN}, or name a checkpoint of your own"
        raise FileFormatError(folder, "the model that comes with the package", found)
    return folder


def _found(path: Path) -> str:
    return (
        ", ".join(sorted(entry.name for entry in path.iterdir() if not is_hidden(entry.name))[:8])
        if path.is_dir()
        else "no such folder"
    )
