"""A checkpoint as a planner: stacked observation histories in, joint plans out."""

import hashlib
import os
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from copolicy.dataset.exceptions import FileFormatError, MissingExtraError

try:
    import torch
    from lerobot.configs.policies import PreTrainedConfig
    from lerobot.policies.factory import get_policy_class, make_pre_post_processors
except ModuleNotFoundError as error:
    raise MissingExtraError(error.name or "lerobot") from None

import lerobot_policy_copolicy  # noqa: F401  (registers the policies; LeRobot itself does so only in its own scripts)


@dataclass
class Planner:
    """A co-policy with its processors, planning for a batch of tables at once.

    Attributes:
        planning_seconds: wall time of each call of `plan`, s.
        batch_sizes: number of tables in each call.
    """

    policy: Any
    preprocess: Any
    postprocess: Any
    path: Path
    planning_seconds: list[float] = field(default_factory=list)
    batch_sizes: list[int] = field(default_factory=list)

    @classmethod
    def load(cls, path: Path | str, device: str = "cpu", **settings: Any) -> "Planner":
        """Reads a checkpoint folder (or one that holds `pretrained_model`), through LeRobot's factory.

        Args:
            settings: fields of the policy's configuration to change, such as `num_inference_steps=5`.

        Raises:
            FileFormatError: the folder holds no co-policy.
        """
        folder = _pretrained_model(Path(path))
        config = PreTrainedConfig.from_pretrained(folder)
        config.device = device
        config.pretrained_path = folder
        for name, value in settings.items():
            if not hasattr(config, name):
                raise FileFormatError(folder, f"a policy with the setting {name!r}", f"type {config.type!r} without")
            setattr(config, name, value)
        policy_class = get_policy_class(config.type)
        if not hasattr(policy_class, "plan"):
            raise FileFormatError(folder, "a policy that plans for both players (method `plan`)", config.type)
        policy = policy_class.from_pretrained(folder, config=config)
        policy.eval()
        preprocess, postprocess = make_pre_post_processors(
            config, pretrained_path=str(folder), preprocessor_overrides={"device_processor": {"device": device}}
        )
        return cls(policy, preprocess, postprocess, folder)

    def plan(self, history: dict[str, np.ndarray], generator: "torch.Generator | None" = None) -> np.ndarray:
        """Plans from the last `To` frames of each table.

        Args:
            history: observation keys to `(B, To, n)` in physical units.

        Returns:
            `(B, T - To + 1, 4)` joint actions in [-1, 1], the first for the current frame.
        """
        started = perf_counter()
        batch = self.preprocess({key: torch.from_numpy(value.astype(np.float32)) for key, value in history.items()})
        with torch.inference_mode():
            plan = self.policy.plan(batch, generator=generator)
        actions = self.postprocess(plan[:, self.policy.config.n_obs_steps - 1 :])
        self.planning_seconds.append(perf_counter() - started)
        self.batch_sizes.append(len(plan))
        return actions.cpu().numpy().astype(float)

    def describe(self) -> dict[str, Any]:
        """What identifies the policy in a report: type, size, settings that matter, hash of the weights."""
        config = self.policy.config
        digest = hashlib.sha256((self.path / "model.safetensors").read_bytes()).hexdigest()
        names = (
            "preset", "past_human_action", "network", "prediction_type", "observation_features", "sampler",
            "num_inference_steps", "initial_noise_scale", "horizon", "n_obs_steps",
        )  # fmt: skip
        return {
            "checkpoint": os.path.relpath(self.path),
            "type": config.type,
            "weights_sha256": digest,
            "parameters": sum(p.numel() for p in self.policy.parameters() if p.requires_grad),
            **{name: getattr(config, name) for name in names if hasattr(config, name)},
        }


def _pretrained_model(path: Path) -> Path:
    """The folder with `config.json`: the given one, its `pretrained_model`, or the last checkpoint of a run."""
    for folder in (path, path / "pretrained_model", path / "checkpoints" / "last" / "pretrained_model"):
        if (folder / "config.json").is_file() and (folder / "model.safetensors").is_file():
            return folder
    raise FileFormatError(path, "a checkpoint folder with config.json and model.safetensors", _listing(path))


def _listing(path: Path) -> str:
    if not path.is_dir():
        return "no such folder"
    return ", ".join(sorted(entry.name for entry in path.iterdir())[:8]) or "an empty folder"
