"""A checkpoint as the planner of a study: it keeps the time of its plans and says what it is."""

import os
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from copolicy.collect.agents.checkpoint import Checkpoint

_SETTINGS = (
    "preset", "past_human_action", "network", "prediction_type", "observation_features", "sampler",
    "num_inference_steps", "planner", "backend", "initial_noise_scale", "horizon", "n_obs_steps",
)  # fmt: skip


class Planner:
    """Plans for a batch of tables at once.

    Attributes:
        checkpoint: the policy.
        frames: how many observations a plan is made from.
        fps: frames a second of the data that it learned from.
        planning_seconds: wall time of each call of `plan`, s.
        batch_sizes: number of tables in each call.
        actions: how many actions of a plan are wanted from the current frame on, the fewer the faster; None for all.
    """

    def __init__(self, path: Path | str, device: str = "cpu", **settings: Any):
        """
        Args:
            settings: fields of the policy's configuration to change, such as `num_inference_steps=5`.

        Raises:
            FileFormatError: no such policy, or one without such a setting.
        """
        self.checkpoint = Checkpoint(Path(path), device=device, settings=settings)
        self.frames = self.checkpoint.frames
        self.fps = self.checkpoint.fps
        self.planning_seconds: list[float] = []
        self.batch_sizes: list[int] = []
        self.actions: int | None = None

    def seed(self, seed: int) -> None:
        """Sets the source of the plans' noise."""
        self.checkpoint.seed(seed)

    def plan(self, history: dict[str, np.ndarray]) -> np.ndarray:
        """Plans from the last frames of each table.

        Args:
            history: observation keys to `(B, frames, n)` in physical units.

        Returns:
            `(B, actions, 4)` joint actions in [-1, 1], the first for the current frame.
        """
        started = perf_counter()
        plans = self.checkpoint.plan_batch(history, self.actions)
        self.planning_seconds.append(perf_counter() - started)
        self.batch_sizes.append(len(plans))
        return plans

    def describe(self) -> dict[str, Any]:
        """What identifies the policy in a report: type, size, settings that matter, digest of the weights."""
        policy = self.checkpoint.policy
        return {
            "checkpoint": os.path.relpath(self.checkpoint.folder),
            "type": policy.config.type,
            "weights_sha256": self.checkpoint.weights_sha256,
            "learned": self.checkpoint.conditions.to_json(),
            "parameters": sum(p.numel() for p in policy.parameters() if p.requires_grad),
            **{name: getattr(policy.config, name) for name in _SETTINGS if hasattr(policy.config, name)},
            **({"planned_with": list(policy.planned_with)} if hasattr(policy, "planned_with") else {}),
        }
