"""Checks before a training that a run, its method and a local data set suit each other."""

from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, STATE
from copolicy.dataset.files.json_file import read_optional_json
from copolicy.dataset.files.meta_files import INFO_FILE

_NEED_STATE = ("act", "diffusion")  # LeRobot's policies that fail without it, naming no data set


def require_type_of_run(source: str | None, policy_type: str | None) -> None:
    """Refuses to read the settings of a run with the flag of another policy type.

    Args:
        source: value of `--config_path`.
        policy_type: value of `--policy.type`.

    Raises:
        FileFormatError: the run is of another type.
    """
    if source is None or policy_type is None:
        return
    folder = Path(source) if Path(source).is_dir() else Path(source).parent
    config = read_optional_json(folder / "config.json", dict[str, Any], "the configuration of a policy") or {}
    if (found := config.get("type", policy_type)) != policy_type:
        raise FileFormatError(source, f"a run of {policy_type}, as --policy.type says", found)


def require_fitting_data(config: Any, source: str | None) -> None:
    """Refuses a local data set without a column that the policy reads, and a resumed run at another rate.

    Args:
        config: LeRobot's `TrainPipelineConfig`.
        source: the run or checkpoint that the policy is of, if it is not new.

    Raises:
        FileFormatError: names the data set.
    """
    root, policy = Path(config.dataset.root), config.policy
    info = read_optional_json(root / INFO_FILE, dict[str, Any], "a data set's meta/info.json") or {}
    features = {config.rename_map.get(name, name): value for name, value in (info.get("features") or {}).items()}
    if policy is None:
        return
    for name in _columns(policy, features):
        if name not in features:
            expected = f"the column {name}, which {policy.type} reads"
            raise FileFormatError(root, expected, ", ".join(sorted(features)) or "none")
    learned = getattr(policy, "fps", None)
    if config.resume and learned is not None and learned != info.get("fps"):
        expected = f"{learned:g} frames a second, as in the data of the resumed run {source}"
        raise FileFormatError(root, expected, str(info.get("fps")))


def _columns(policy: Any, features: dict[str, Any]) -> tuple[str, ...]:
    """Columns that a policy cannot do without; of policies that do not state them, those that are known."""
    own = getattr(policy, "observation_keys", None)
    if own is not None:
        return (*own, ACTION)
    if policy.type not in _NEED_STATE:
        return ()
    images = any(feature.get("dtype") in ("image", "video") for feature in features.values())
    return (STATE, ACTION) if images else (STATE, ENVIRONMENT_STATE, ACTION)
