"""Loads a LeRobot policy from a checkpoint and predicts joint action chunks from observation histories.

Registered in the entry point group `copolicy.policies`, through which `copolicy.collect` loads policies.
"""

import contextlib
import hashlib
import io
import os
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import torch
from lerobot.configs.policies import PreTrainedConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors

from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
from copolicy.collect.agents.training_conditions import TrainingConditions, training_conditions
from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import CopolicyError, FileFormatError, RunError
from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.dataset.task import PairTask, get_task

from .plugins import register_plugins
from .processor_files import processors_sha256

_OBSERVATIONS = (STATE, ENVIRONMENT_STATE, HUMAN_ACTION)
_DESCRIBED = (
    "preset", "past_human_action", "network", "inpainting", "prediction_type", "observation_features", "sampler",
    "num_inference_steps", "timestep_spacing", "planner", "backend", "initial_noise_scale", "horizon", "n_obs_steps",
    "code",
)  # fmt: skip
_LOCK = threading.Lock()  # policies draw from torch's global generator, whose state each call sets


class Checkpoint:
    """A policy for both players, with its processors (see `copolicy.collect.agents.Policy`).

    Calls a policy as LeRobot does: `predict_action_chunk` on a batch of its input features, `(B, frames, n)` if its
    configuration has `observation_delta_indices` and `(B, n)` if not. If that fails, `select_action` is called at every
    frame; such a policy keeps its own queues of observations and actions.

    Attributes:
        name: type and first digits of the weights' sha256.
        task: name of the task that it was trained on.
        folder: folder of `config.json` and the weights.
        policy: LeRobot's policy.
        conditions: rate and world settings of its training data.
        fps: actions per second.
        n_obs_steps: frames of history from which a chunk is predicted.
        n_action_steps: actions of a chunk that are executed before the next chunk.
        chunk_size: largest number of actions in a chunk, from the newest frame on.
        n_predicted_actions: number of actions to predict, fewer are faster; all if None.
        keeps_history: whether it is called at every frame; known after the first call.
        inference_seconds: wall time of each call, s.
        batch_sizes: number of worlds in each call.
    """

    def __init__(self, path: Path | str, device: str = "cpu", settings: Mapping[str, Any] | None = None):
        """
        Args:
            path: checkpoint or run folder, or `pretrained`; see `checkpoint_folder`.
            device: device of the policy.
            settings: fields of the policy's configuration to override, such as `num_inference_steps`.

        Raises:
            FileFormatError: the policy cannot be loaded, does not act for both players from observations of the task,
                or lacks one of the settings.
        """
        self.folder: Path = (folder := checkpoint_folder(path))
        self.conditions: TrainingConditions = training_conditions(folder)
        self.fps: int = self.conditions.fps
        try:
            policy, self._preprocess, self._postprocess = _load(
                folder, device, settings or {}, get_task(self.conditions.task)
            )
        except CopolicyError:
            raise
        except Exception as error:
            raise FileFormatError(
                folder, "a policy that LeRobot can load", f"{type(error).__name__}: {error}"
            ) from error
        self.policy: Any = policy
        self.weights_sha256: str = hashlib.sha256((folder / "model.safetensors").read_bytes()).hexdigest()
        self._processors_sha256 = processors_sha256(folder)
        self._config: Any = self.policy.config
        self.task: str = self.conditions.task
        self.name: str = f"policy:{self._config.type}-{self.weights_sha256[:8]}"
        indices = self._config.observation_delta_indices
        self._indices = None if indices is None else [index - 1 for index in indices if index <= 0]
        self.n_obs_steps: int = -min(self._indices or [-1])
        self.n_action_steps: int = int(getattr(self._config, "n_action_steps", 1))
        ahead = getattr(self._config, "horizon", 0) - self.n_obs_steps + 1
        self.chunk_size: int = int(max(self.n_action_steps, ahead, getattr(self._config, "chunk_size", 0)))
        self.n_predicted_actions: int | None = None
        # Only `select_action` computes a temporal ensemble over chunks.
        self.keeps_history: bool = getattr(self._config, "temporal_ensemble_coeff", None) is not None
        self.inference_seconds: list[float] = []
        self.batch_sizes: list[int] = []
        self._devices = ["cpu", device] if torch.device(device).type == "cuda" else ["cpu"]
        self._succeeded = False
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Starts episodes: clears the policy's queues and seeds its random numbers."""
        with _LOCK:
            self.policy.reset()
        self._noise = {device: torch.Generator(device).manual_seed(seed).get_state() for device in self._devices}

    def predict_action_chunk(self, observations: dict[str, Array]) -> Array:
        """Predicts the action chunks of a batch of worlds.

        Args:
            observations: columns `(B, n_obs_steps, n)`, oldest frame first, in physical units.

        Returns:
            `(B, n_predicted_actions, m)` joint actions, the first for the newest frame; `(B, 1, m)` if `keeps_history`.

        Raises:
            RunError: both `predict_action_chunk` and `select_action` fail.
        """
        started = perf_counter()
        with self._random_numbers_of_policy(), torch.inference_mode():
            actions = self._postprocess(self._chunk(observations)).cpu().numpy().astype(float)
        self.inference_seconds.append(perf_counter() - started)
        self.batch_sizes.append(len(actions))
        return actions[:, : self.n_predicted_actions]

    def describe(self) -> dict[str, Any]:
        """The `policy` entry of a result: type, size, inference settings, sha256 of weights and of processors."""
        return {
            "checkpoint": os.path.relpath(self.folder),
            "type": self._config.type,
            "weights_sha256": self.weights_sha256,
            "processors_sha256": self._processors_sha256,
            "learned": self.conditions.to_json(),
            "parameters": sum(p.numel() for p in self.policy.parameters() if p.requires_grad),
            **{name: getattr(self._config, name) for name in _DESCRIBED if hasattr(self._config, name)},
            **({"masked_state": masked} if (masked := getattr(self._config, "masked_state", None)) else {}),
            **({"planned_with": list(backends)} if (backends := getattr(self.policy, "planned_with", ())) else {}),
        }

    def _chunk(self, observations: dict[str, Array]) -> torch.Tensor:
        first_error = None
        if not self.keeps_history:
            executed = self._config.n_action_steps
            # The co-policy predicts `n_action_steps` actions instead of the whole chunk, which is faster.
            self._config.n_action_steps = self.n_predicted_actions or self.chunk_size
            try:
                actions = self.policy.predict_action_chunk(self._batch(observations, self._indices))
                self._succeeded = True
                return actions
            except Exception as error:
                if self._succeeded:
                    raise
                first_error = error
            finally:
                self._config.n_action_steps = executed
        try:
            if first_error is not None:
                self.policy.reset()
            actions = self.policy.select_action(self._batch(observations, None))[:, None]
        except Exception as error:
            cause = first_error or error
            expected = "expected actions from predict_action_chunk or select_action"
            raise RunError(f"{self.folder}: {expected}, found {type(cause).__name__}: {cause}") from cause
        self.keeps_history = self._succeeded = True
        return actions

    def _batch(self, observations: dict[str, Array], indices: list[int] | None) -> dict[str, torch.Tensor]:
        frames = -1 if indices is None else indices
        keys = self._config.input_features
        return self._preprocess(
            {key: torch.from_numpy(observations[key][:, frames].astype(np.float32)) for key in keys}
        )

    @contextlib.contextmanager
    def _random_numbers_of_policy(self) -> Iterator[None]:
        """Gives torch the policy's random state during a call, so that other draws in the process do not affect it."""
        with _LOCK:
            before = {device: _random_state(device) for device in self._noise}
            for device, state in self._noise.items():
                _set_random_state(device, state)
            try:
                yield
            finally:
                for device, state in before.items():
                    self._noise[device] = _random_state(device)
                    _set_random_state(device, state)


def read_configuration(folder: Path) -> Any:
    """The configuration of a checkpoint as the installed version reads it; settings that it lacks have their default.

    Raises:
        FileFormatError: it cannot be read.
    """
    register_plugins()
    try:
        return PreTrainedConfig.from_pretrained(folder)
    except Exception as error:
        raise FileFormatError(folder, "a policy that LeRobot can load", f"{type(error).__name__}: {error}") from error


def _load(folder: Path, device: str, settings: Mapping[str, Any], task: PairTask) -> tuple[Any, Any, Any]:
    config = read_configuration(folder)
    config.device = device
    config.pretrained_path = folder
    for setting, value in settings.items():
        if not hasattr(config, setting):
            raise FileFormatError(folder, f"a policy with the setting {setting!r}", f"{config.type} without it")
        setattr(config, setting, value)
    if settings:
        config.__post_init__()  # checks the settings
    if unknown := sorted(set(config.input_features) - set(_OBSERVATIONS)):
        expected = f"a policy that observes {', '.join(_OBSERVATIONS)} at most"
        raise FileFormatError(folder, expected, f"one that also needs {', '.join(unknown)}")
    size, feature = len(task.spec.joint_action), config.action_feature
    if feature is None or tuple(feature.shape) != (size,):
        found = "none" if feature is None else f"actions of {tuple(feature.shape)}"
        raise FileFormatError(folder, f"a policy for both players, with actions of ({size},)", found)
    with contextlib.redirect_stdout(io.StringIO()):  # LeRobot prints while it loads
        policy = get_policy_class(config.type).from_pretrained(folder, config=config)
    policy.eval()
    for name, values in policy.state_dict().items():
        if values.is_floating_point() and not bool(torch.isfinite(values).all()):
            raise FileFormatError(folder, "finite weights", f"nan or infinity in {name}")
    overrides = {"device_processor": {"device": device}}
    processors = make_pre_post_processors(config, pretrained_path=str(folder), preprocessor_overrides=overrides)
    return policy, *processors


def _random_state(device: str) -> torch.Tensor:
    return torch.get_rng_state() if device == "cpu" else torch.cuda.get_rng_state(device)


def _set_random_state(device: str, state: torch.Tensor) -> None:
    if device == "cpu":
        torch.set_rng_state(state)
    else:
        torch.cuda.set_rng_state(state, device)
