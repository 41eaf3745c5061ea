"""A policy's checkpoint, loaded through LeRobot's factory: histories in, joint plans out.

Collecting needs no torch. This module is for a policy at the stick alone, and imports torch and LeRobot by name when
a checkpoint is loaded, never before.
"""

import contextlib
import hashlib
import io
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.exceptions import CopolicyError, FileFormatError, MissingExtraError

from .checkpoint_folder import checkpoint_folder
from .training_conditions import training_conditions


class Checkpoint:
    """A policy that plans for both players, with its processors.

    Attributes:
        name: type and the beginning of its weights' digest.
        folder: where `config.json` and the weights are.
        weights_sha256: digest of the weights.
        policy: LeRobot's policy.
        frames: how many observations a plan is made from.
        planned_frames: how many actions a plan holds from the newest observation on.
        actions_per_plan: frames of a plan that are executed before the next one (LeRobot's `n_action_steps`).
        conditions: rate and physics that it learned at.
        fps: the rate, frames a second.
    """

    def __init__(self, path: Path | str, seed: int = 0, device: str = "cpu", settings: Mapping[str, Any] | None = None):
        """
        Args:
            path: the folder of the policy, one that holds `pretrained_model`, that of a training run, or `pretrained`
                for the model that comes with the package.
            seed: of the plans' noise.
            device: where it plans.
            settings: fields of the policy's configuration to change, such as `num_inference_steps`.

        Raises:
            FileFormatError: the folder holds no policy that plans for both players, or one without such a setting.
            MissingExtraError: torch or LeRobot is not installed.
        """
        folder = checkpoint_folder(path)
        self.conditions = training_conditions(folder)
        self.fps = self.conditions.fps
        try:
            self._torch = import_module("torch")
            config_class = import_module("lerobot.configs.policies").PreTrainedConfig
            factory = import_module("lerobot.policies.factory")
            import_module("lerobot.utils.import_utils").register_third_party_plugins()
        except ModuleNotFoundError as error:
            raise MissingExtraError(error.name or "lerobot") from None
        try:
            config = config_class.from_pretrained(folder)
            config.device = device
            config.pretrained_path = folder
            for setting, value in (settings or {}).items():
                if not hasattr(config, setting):
                    raise FileFormatError(folder, f"a policy with the setting {setting!r}", f"{config.type} without it")
                setattr(config, setting, value)
            if settings:
                config.__post_init__()  # which checks what it is given
            policy_class = factory.get_policy_class(config.type)
            if not hasattr(policy_class, "plan"):
                raise FileFormatError(folder, "a policy that plans for both players (method `plan`)", config.type)
            with contextlib.redirect_stdout(io.StringIO()):  # LeRobot prints while it loads
                self.policy = policy_class.from_pretrained(folder, config=config)
            self.policy.eval()
            _require_finite(folder, self.policy, self._torch)
            self._preprocess, self._postprocess = factory.make_pre_post_processors(
                config, pretrained_path=str(folder), preprocessor_overrides={"device_processor": {"device": device}}
            )
        except CopolicyError:
            raise
        except Exception as error:
            raise FileFormatError(
                folder, "a policy that LeRobot can load", f"{type(error).__name__}: {error}"
            ) from error
        self.folder = folder
        self.weights_sha256 = hashlib.sha256((folder / "model.safetensors").read_bytes()).hexdigest()
        self.name = f"policy:{config.type}-{self.weights_sha256[:8]}"
        self.frames = int(config.n_obs_steps)
        self.planned_frames = int(config.horizon) - self.frames + 1
        self.actions_per_plan = int(config.n_action_steps)
        self._generator = self._torch.Generator().manual_seed(seed)

    def seed(self, seed: int) -> None:
        """Sets the source of the plans' noise."""
        self._generator.manual_seed(seed)

    def plan(self, history: dict[str, np.ndarray]) -> np.ndarray:
        """Plans for one table from its last frames.

        Args:
            history: observation keys to `(frames, n)`, oldest first, in physical units.

        Returns:
            `(planned_frames, 4)` joint actions, the first for the newest frame.
        """
        return self.plan_batch({key: value[None] for key, value in history.items()})[0]

    def plan_batch(self, history: dict[str, np.ndarray], actions: int | None = None) -> np.ndarray:
        """Plans for several tables at once: histories `(B, frames, n)` to plans `(B, planned_frames, 4)`.

        Args:
            actions: how many are wanted, the fewer the faster; all that are planned if None.
        """
        torch = self._torch
        batch = {key: torch.from_numpy(value.astype(np.float32)) for key, value in history.items()}
        with torch.inference_mode():
            plan = self.policy.plan(self._preprocess(batch), generator=self._generator, actions=actions)
        return self._postprocess(plan[:, self.frames - 1 :]).cpu().numpy().astype(float)


def _require_finite(folder: Path, policy: Any, torch: Any) -> None:
    for name, values in policy.state_dict().items():
        if values.is_floating_point() and not bool(torch.isfinite(values).all()):
            raise FileFormatError(folder, "finite weights", f"nan or infinity in {name}")
