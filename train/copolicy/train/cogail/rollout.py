"""Frames of the policy in the worlds, their advantages, and the scale of rewards."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from copolicy.dataset.arrays import Array

from .learner import Learner
from .worlds import RestartingWorlds


@dataclass
class PolicyFrames:
    """T frames of W worlds under the policy.

    Attributes:
        inputs: `(T, W, size)` encoded observations.
        codes: `(T, W, 2)`.
        actions: `(T, W, 2 m)` drawn joint actions, scaled to [-1, 1] but not clipped.
        log_probabilities: `(T, W)` of the actions.
        values: `(T, W)` of the frames.
        next_values: `(T, W)` of the frames that follow in the episode: at a truncation that of the last state, at any
            other end zero.
        ended, succeeded: `(T, W)` whether the episode ended in the frame, and in success.
    """

    inputs: Array
    codes: Array
    actions: Array
    log_probabilities: Array
    values: Array
    next_values: Array
    ended: Array
    succeeded: Array


def collect(
    learner: Learner,
    worlds: RestartingWorlds,
    encode: Callable[[Any, Any], Any],
    physical: Callable[[Any], Any],
    frames: int,
) -> PolicyFrames:
    """Steps all worlds for T frames with actions drawn from the policy.

    Args:
        encode: inputs of histories and scenarios, as torch tensors.
        physical: actions in the task's units, of actions scaled to [-1, 1], as torch tensors.
        frames: T.
    """
    rows: dict[str, list[Array]] = {name: [] for name in PolicyFrames.__dataclass_fields__}
    inputs, codes = encode(worlds.histories, worlds.scenarios).numpy(), worlds.codes.numpy().copy()
    for _ in range(frames):
        means, values = learner.means_and_values(inputs, codes)
        noise = torch.randn(means.shape).numpy()
        actions = means + np.exp(learner.log_deviation) * noise
        step = worlds.step(physical(torch.from_numpy(actions.clip(-1.0, 1.0))).double().numpy())
        next_values = np.zeros_like(values)
        if step.truncated.any():
            final = encode(step.final_histories, step.final_scenarios).numpy()
            next_values[step.truncated] = learner.means_and_values(final, step.final_codes.numpy())[1]
        acted = inputs, codes, actions, learner.log_probabilities(actions, means)
        row = *acted, values, next_values, step.ended, step.succeeded
        for name, of_frame in zip(rows, row, strict=True):
            rows[name].append(of_frame)
        inputs, codes = encode(worlds.histories, worlds.scenarios).numpy(), worlds.codes.numpy().copy()
    collected = PolicyFrames(**{name: np.stack(values) for name, values in rows.items()})
    following = np.concatenate((collected.values[1:], learner.means_and_values(inputs, codes)[1][None]))
    collected.next_values = np.where(collected.ended, collected.next_values, following)
    return collected


def advantages(
    rewards: Array, values: Array, next_values: Array, ended: Array, gamma: float, gae_lambda: float
) -> Array:
    """Generalised advantage estimates `(T, W)` (Schulman et al., 2016, eq. 16).

    Args:
        rewards, values, next_values, ended: `(T, W)`; see `PolicyFrames`.
    """
    differences = rewards + gamma * next_values - values
    estimates, following = np.zeros_like(differences), np.zeros_like(differences[0])
    for frame in range(len(rewards) - 1, -1, -1):
        following = differences[frame] + gamma * gae_lambda * following * ~ended[frame]
        estimates[frame] = following
    return estimates


class RewardScale:
    """Divides rewards by the running standard deviation of the discounted return of each world."""

    def __init__(self, worlds: int, gamma: float):
        self._gamma = gamma
        self._returns: Array = np.zeros(worlds)
        self._mean, self._variance, self._count = 0.0, 1.0, 1e-4

    @property
    def deviation(self) -> float:
        """The present divisor."""
        return math.sqrt(self._variance + 1e-8)

    def scaled(self, rewards: Array, ended: Array) -> Array:
        """Rewards `(T, W)` of consecutive frames, each divided by the standard deviation up to its frame."""
        scaled = np.empty_like(rewards)
        for frame, (reward, end) in enumerate(zip(rewards, ended, strict=True)):
            self._returns = self._returns * self._gamma + reward
            self._observe(self._returns)
            scaled[frame] = reward / self.deviation
            self._returns = self._returns * ~end
        return scaled

    def _observe(self, returns: Array) -> None:
        """Adds a batch to the running mean and variance (Chan et al.)."""
        count = len(returns)
        mean, variance = float(returns.mean()), float(returns.var())
        total, difference = self._count + count, mean - self._mean
        squares = self._variance * self._count + variance * count + difference**2 * self._count * count / total
        self._mean += difference * count / total
        self._variance, self._count = squares / total, total

    def state(self) -> dict[str, Any]:
        """Everything that a resumed training needs."""
        moments = {"mean": self._mean, "variance": self._variance, "count": self._count}
        return {"returns": torch.from_numpy(self._returns.copy()), **moments}

    def load(self, state: dict[str, Any]) -> None:
        """Restores `state`."""
        self._returns = state["returns"].numpy().copy()
        self._mean, self._variance, self._count = (float(state[name]) for name in ("mean", "variance", "count"))
