"""The discriminator's training, and the reward that it gives."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from copolicy.dataset.arrays import Array
from lerobot_policy_copolicy.cogail.network import Discriminator

from .layers import Adam, Dense, Flat, joined, norms_and_slopes, shuffled

Sample = Callable[[int], tuple[Array, Array]]
"""Draws a number of demonstrated frames: inputs and actions."""


class Adversary:
    """A discriminator with its optimizer.

    The loss is binary cross-entropy with demonstrated frames as ones, and a gradient penalty at random points between
    demonstrated and policy frames (Gulrajani et al., 2017). The reward is log D - log(1 - D), the logit, or
    -log(1 - D), which is positive.

    Attributes:
        discriminator: the network, whose weights training changes in place.
    """

    def __init__(self, discriminator: Discriminator, lr: float, penalty: float, batch_size: int, reward: str = "logit"):
        self.discriminator = discriminator
        self._flat = Flat(discriminator)
        self._network, self._optimizer = Dense(discriminator.network, self._flat), Adam(self._flat, lr)
        self._penalty, self._batch_size, self._positive = penalty, batch_size, reward == "positive"

    def train(self, frames: Array, sample: Sample, passes: int) -> dict[str, float]:
        """Trains for a number of passes over the policy's frames.

        Args:
            frames: `(N, size + 2 m)` of the policy.
            sample: of demonstrated frames.
            passes: number of passes.

        Returns:
            Means of the last pass: loss, gradient penalty, and the proportions of demonstrated and policy frames that
            are recognised.
        """
        size = min(self._batch_size, len(frames))
        batches = len(frames) // size
        metrics: list[tuple[float, ...]] = []
        for _ in range(passes):
            (policy,) = shuffled([frames], batches * size)
            expert = joined(*sample(batches * size))
            mix = torch.rand((batches * size, 1)).numpy()
            between = mix * expert + (1 - mix) * policy
            metrics = []
            for start in range(0, batches * size, size):
                rows = slice(start, start + size)
                metrics.append(self.add_gradient(expert[rows], policy[rows], between[rows]))
                self._optimizer.step()
        names = ("discriminator_loss", "gradient_penalty", "expert_accuracy", "policy_accuracy")
        return dict(zip(names, np.mean(metrics, axis=0).tolist(), strict=True))

    def add_gradient(self, expert: Array, policy: Array, between: Array) -> tuple[float, ...]:
        """Adds the gradient of the loss of a minibatch of `(B, size + 2 m)` frames each.

        Returns:
            Cross-entropy, gradient penalty, proportions of demonstrated and policy frames that are recognised.
        """
        size, labelled = len(expert), 2 * len(expert)
        (w1, d_w1, _, d_b1), (w2, d_w2, _, d_b2), (w3, d_w3, _, d_b3) = self._network.weights
        x, h1, h2, logits = self._network.forward(np.concatenate((expert, policy, between))).activations
        k1, k2 = 1 - h1 * h1, 1 - h2 * h2  # derivatives of the two tanh
        signed = logits[:labelled, 0] * np.repeat((-1, 1), size).astype(np.float32)
        cross_entropy = 2 * float(np.logaddexp(0, signed).mean())
        # Derivatives of the cross-entropy by the logits: -(1 - D) for demonstrated frames, D for the policy's.
        slopes = np.repeat((-1, 1), size).astype(np.float32) / (1 + np.exp(-signed)) / size
        d_w3 += slopes @ h2[:labelled]
        d_b3 += slopes.sum()
        a2 = np.empty_like(h2)
        a2[:labelled] = slopes[:, None] * w3

        # The gradient of the logit by the frame, (B, size + 2 m), and the derivatives of its penalty.
        s2 = k2[labelled:] * w3
        t = s2 @ w2
        s1 = k1[labelled:] * t
        norms, direction = norms_and_slopes(s1 @ w1)
        d_g = (2 * self._penalty / size * (norms - 1))[:, None] * direction
        d_s1 = d_g @ w1.T
        d_w1 += s1.T @ d_g
        d_t = d_s1 * k1[labelled:]
        d_s2 = d_t @ w2.T
        d_w2 += s2.T @ d_t
        d_w3 += (d_s2 * k2[labelled:]).sum(axis=0)
        a2[labelled:] = -2 * h2[labelled:] * (d_s2 * w3)

        a2 *= k2
        d_w2 += a2.T @ h1
        d_b2 += a2.sum(axis=0)
        a1 = a2 @ w2
        a1[labelled:] -= 2 * h1[labelled:] * (d_s1 * t)
        a1 *= k1
        d_w1 += a1.T @ x
        d_b1 += a1.sum(axis=0)
        recognised = signed < 0
        penalty = float(np.square(norms - 1).mean())
        return cross_entropy, penalty, float(recognised[:size].mean()), float(recognised[size:].mean())

    def reward(self, frames: Array) -> Array:
        """Rewards `(N,)` of frames `(N, size + 2 m)`."""
        logits = self._network.forward(frames).output[:, 0]
        return np.logaddexp(0, logits) if self._positive else logits

    def state(self) -> dict[str, Any]:
        """Everything that a resumed training needs."""
        return {"values": torch.from_numpy(self._flat.values.copy()), "optimizer": self._optimizer.state()}

    def load(self, state: dict[str, Any]) -> None:
        """Restores `state`."""
        self._flat.values[:] = state["values"].numpy()
        self._optimizer.load(state["optimizer"])
