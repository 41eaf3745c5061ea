"""Folders of policies: a checkpoint, a training run, or the model that comes with the package."""

from collections.abc import Mapping
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.extras import POLICIES, require_packages
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.listing import is_hidden
from copolicy.dataset.policies.training_run import POLICY_FILES, find_policy_folder

PRETRAINED = "pretrained"
"""Name that replaces a path: the model that comes with the package."""

_PLUGIN = "lerobot_policy_copolicy"
_ENTRY_POINTS = "copolicy.policies"


def load_policy(path: Path | str, device: str = "cpu", settings: Mapping[str, Any] | None = None) -> Any:
    """Loads a `Policy`, with its `TrainingConditions` as the attribute `conditions`.

    The loader is the entry point `lerobot` of the group `copolicy.policies`, so that collecting needs no torch.

    Args:
        path: see `checkpoint_folder`.
        device: torch device of the policy.
        settings: fields of the policy's configuration to change, such as `num_inference_steps`.

    Raises:
        FileFormatError: no such policy, or one that cannot act in this task or lacks such a setting.
        MissingExtraError: torch or LeRobot is not installed.
    """
    folder = checkpoint_folder(path)
    require_packages(*POLICIES)
    (loader,) = entry_points(group=_ENTRY_POINTS, name="lerobot")
    return loader.load()(folder, device, settings)


def checkpoint_folder(path: Path | str) -> Path:
    """Finds the folder with `config.json` and `model.safetensors`.

    Args:
        path: that folder, a folder with `pretrained_model` in it, the folder of a training run (its newest checkpoint,
            see `find_policy_folder`), or `pretrained`.

    Raises:
        FileFormatError: there is no checkpoint.
    """
    if str(path) == PRETRAINED:
        return pretrained_folder()
    path = Path(path)
    folder = find_policy_folder(path)
    if folder is not None:
        return folder
    expected = f"a checkpoint folder with {' and '.join(POLICY_FILES)}"
    found = "no such folder"
    if path.is_dir():
        names = sorted(entry.name for entry in path.iterdir() if not is_hidden(entry.name))
        found = ", ".join(names[:8]) or "an empty folder"
    raise FileFormatError(path, expected, found)


def pretrained_folder() -> Path:
    """The folder of the model that comes with the package.

    The plugin is located without importing it, since its import needs LeRobot.

    Raises:
        FileFormatError: this installation lacks the plugin or its model.
    """
    spec = find_spec(_PLUGIN)
    locations = list((spec and spec.submodule_search_locations) or ())
    if not locations:
        raise FileFormatError(PRETRAINED, f"the package {_PLUGIN} with its model", "no such package")
    folder = Path(locations[0]) / PRETRAINED
    missing = [name for name in POLICY_FILES if not (folder / name).is_file()]
    if missing:
        found = f"none named {' and '.join(missing)}; reinstall {_PLUGIN}, or name a checkpoint of your own"
        raise FileFormatError(folder, "the model that comes with the package", found)
    return folder
