"""A policy of LeRobot's from its checkpoint: observation histories in, joint action chunks out.

Registered in the entry point group `copolicy.policies`, by which collect finds it when a policy is to act at a seat.
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
from lerobot.utils.import_utils import register_third_party_plugins

from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
from copolicy.collect.agents.training_conditions import training_conditions
from copolicy.dataset.exceptions import CopolicyError, FileFormatError, RunError
from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.dataset.task import PairTask, get_task

_OBSERVATIONS = (STATE, ENVIRONMENT_STATE, HUMAN_ACTION)
_DESCRIBED = (
    "preset", "past_human_action", "network", "prediction_type", "observation_features", "sampler",
    "num_inference_steps", "planner", "backend", "initial_noise_scale", "horizon", "n_obs_steps",
)  # fmt: skip
_LOCK = threading.Lock()  # policies draw from torch's global random numbers, which each call of a checkpoint sets


class Checkpoint:
    """A policy for both players, with its processors (see `copolicy.collect.agents.Policy`).

    It asks of a policy what LeRobot does: `predict_action_chunk` on a batch of the features that its configuration
    names, `(B, frames, n)` where that has `observation_delta_indices` and `(B, n)` where not. Policies that only answer
    after `select_action`, which keeps a queue of observations and actions of its own, are called frame by frame.

    Attributes:
        name: type and the beginning of its weights' digest.
        task: name of the task that it learned.
        folder: where `config.json` and the weights are.
        weights_sha256: digest of the weights.
        policy: LeRobot's policy.
        conditions: rate and physics that it learned at.
        fps: the rate, frames a second, for which an action is held.
        n_obs_steps: frames of history that a chunk is predicted from.
        n_action_steps: actions of a chunk that are executed before the next chunk.
        chunk_size: actions that a chunk holds at most, from the newest frame on.
        wanted: how many of them are predicted, the fewer the faster; all if None.
        keeps_history: it is called frame by frame; known after the first call.
        planning_seconds: wall time of each call, s.
        batch_sizes: number of worlds in each call.
    """

    def __init__(self, path: Path | str, device: str = "cpu", settings: Mapping[str, Any] | None = None):
        """
        Args:
            path: see `checkpoint_folder`.
            device: where it predicts.
            settings: fields of the policy's configuration to change, such as `num_inference_steps`.

        Raises:
            FileFormatError: no such policy, one that does not act for both players from observations of the task, or
                one without such a setting.
        """
        self.folder = folder = checkpoint_folder(path)
        self.conditions = training_conditions(folder)
        self.fps = self.conditions.fps
        register_third_party_plugins()
        try:
            self.policy, self._preprocess, self._postprocess = _loaded(
                folder, device, settings or {}, get_task(self.conditions.task)
            )
        except CopolicyError:
            raise
        except Exception as error:
            raise FileFormatError(
                folder, "a policy that LeRobot can load", f"{type(error).__name__}: {error}"
            ) from error
        self.weights_sha256 = hashlib.sha256((folder / "model.safetensors").read_bytes()).hexdigest()
        self._config: Any = self.policy.config
        self.task = self.conditions.task
        self.name = f"policy:{self._config.type}-{self.weights_sha256[:8]}"
        indices = self._config.observation_delta_indices
        self._indices = None if indices is None else [index - 1 for index in indices if index <= 0]
        self.n_obs_steps = -min(self._indices or [-1])
        self.n_action_steps = int(getattr(self._config, "n_action_steps", 1))
        ahead = getattr(self._config, "horizon", 0) - self.n_obs_steps + 1
        self.chunk_size = int(max(self.n_action_steps, ahead, getattr(self._config, "chunk_size", 0)))
        self.wanted: int | None = None
        # An ensemble over chunks is made by `select_action` alone.
        self.keeps_history = getattr(self._config, "temporal_ensemble_coeff", None) is not None
        self.planning_seconds: list[float] = []
        self.batch_sizes: list[int] = []
        self._devices = ["cpu", device] if torch.device(device).type == "cuda" else ["cpu"]
        self._answered = False
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Episodes begin: forgets the queues of the policy, and sets the source of its noise."""
        with _LOCK:
            self.policy.reset()
        self._noise = {device: torch.Generator(device).manual_seed(seed).get_state() for device in self._devices}

    def predict_action_chunk(self, observations: dict[str, np.ndarray]) -> np.ndarray:
        """Predicts for several worlds at once.

        Args:
            observations: columns `(B, n_obs_steps, n)`, oldest frame first, in physical units.

        Returns:
            `(B, wanted, m)` joint actions, the first for the newest frame; `(B, 1, m)` where `keeps_history`.

        Raises:
            RunError: the policy answers neither way.
        """
        started = perf_counter()
        with self._own_noise(), torch.inference_mode():
            actions = self._postprocess(self._chunk(observations)).cpu().numpy().astype(float)
        self.planning_seconds.append(perf_counter() - started)
        self.batch_sizes.append(len(actions))
        return actions[:, : self.wanted]

    def describe(self) -> dict[str, Any]:
        """What identifies the policy in a result: type, size, settings that matter, digest of the weights."""
        return {
            "checkpoint": os.path.relpath(self.folder),
            "type": self._config.type,
            "weights_sha256": self.weights_sha256,
            "learned": self.conditions.to_json(),
            "parameters": sum(p.numel() for p in self.policy.parameters() if p.requires_grad),
            **{name: getattr(self._config, name) for name in _DESCRIBED if hasattr(self._config, name)},
            **({"planned_with": list(backends)} if (backends := getattr(self.policy, "planned_with", ())) else {}),
        }

    def _chunk(self, observations: dict[str, np.ndarray]) -> torch.Tensor:
        failed = None
        if not self.keeps_history:
            executed = self._config.n_action_steps
            # By this the policies that cut their chunks know how much is wanted.
            self._config.n_action_steps = self.wanted or self.chunk_size
            try:
                actions = self.policy.predict_action_chunk(self._batch(observations, self._indices))
                self._answered = True
                return actions
            except Exception as error:
                if self._answered:
                    raise
                failed = error
            finally:
                self._config.n_action_steps = executed
        try:
            if failed is not None:
                self.policy.reset()
            actions = self.policy.select_action(self._batch(observations, None))[:, None]
        except Exception as error:
            first = failed or error
            expected = "expected actions from predict_action_chunk or select_action"
            raise RunError(f"{self.folder}: {expected}, found {type(first).__name__}: {first}") from first
        self.keeps_history = self._answered = True
        return actions

    def _batch(self, observations: dict[str, np.ndarray], indices: list[int] | None) -> dict[str, torch.Tensor]:
        frames = -1 if indices is None else indices
        keys = self._config.input_features
        return self._preprocess(
            {key: torch.from_numpy(observations[key][:, frames].astype(np.float32)) for key in keys}
        )

    @contextlib.contextmanager
    def _own_noise(self) -> Iterator[None]:
        """Random numbers that depend on the seed and the calls since, and nothing else in the process."""
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


def _loaded(folder: Path, device: str, settings: Mapping[str, Any], task: PairTask) -> tuple[Any, Any, Any]:
    config: Any = PreTrainedConfig.from_pretrained(folder)
    config.device = device
    config.pretrained_path = folder
    for setting, value in settings.items():
        if not hasattr(config, setting):
            raise FileFormatError(folder, f"a policy with the setting {setting!r}", f"{config.type} without it")
        setattr(config, setting, value)
    if settings:
        config.__post_init__()  # which checks what it is given
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
