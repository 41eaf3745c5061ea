"""Where a policy lies on the disk: in a checkpoint, in a training run, or beside LeRobot's plugin of this package."""

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
"""In the place of a path: the model that comes with the package."""

_PLUGIN = "lerobot_policy_copolicy"
_ENTRY_POINTS = "copolicy.policies"


def load_policy(path: Path | str, device: str = "cpu", settings: Mapping[str, Any] | None = None) -> Any:
    """A policy as it can act at a seat: a `Policy` with the `TrainingConditions` that it learned at, `conditions`.

    Collecting needs no torch: what loads a checkpoint is found by its name, `lerobot`, in the entry point group
    `copolicy.policies`.

    Args:
        path: see `checkpoint_folder`.
        device: where it predicts.
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
