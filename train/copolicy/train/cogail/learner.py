"""The policy's networks with their optimizer: behaviour cloning before, and PPO with the losses of the code."""

import math
from typing import Any, NamedTuple

import numpy as np
import torch

from copolicy.dataset.arrays import Array
from lerobot_policy_copolicy.cogail.configuration_cogail import CoGailConfig
from lerobot_policy_copolicy.cogail.network import CODE_SIZE, CoGailNetwork

from .adversary import Sample
from .layers import Adam, Dense, Flat, joined, norms_and_slopes

_METRICS = ("policy_loss", "value_loss", "kl", "clipped", "code_loss", "inverse_loss")
_CODE = slice(-CODE_SIZE, None)  # columns of the actor's input


class Minibatch(NamedTuple):
    """B frames of the policy: inputs, codes, actions, and of each its log-probability and value before the update,
    its return and its normalised advantage."""

    inputs: Array
    codes: Array
    actions: Array
    log_probabilities: Array
    values: Array
    returns: Array
    advantages: Array


class Learner:
    """Actor, critic and inverse model in training.

    Attributes:
        flat: their weights and gradient.
        log_deviation: `(2 m,)` logarithm of the standard deviation of the actions.
    """

    def __init__(self, network: CoGailNetwork, settings: CoGailConfig):
        self._settings, self._partner = settings, network.partner
        self.flat = Flat(network)
        self._actor, self._critic, self._inverse = (
            Dense(part, self.flat) for part in (network.actor, network.critic, network.inverse)
        )
        self.log_deviation, self._deviation_gradient = self.flat.of(network.log_deviation)
        self.optimizer = Adam(self.flat, settings.optimizer_lr, settings.optimizer_eps)

    def means_and_values(self, inputs: Array, codes: Array) -> tuple[Array, Array]:
        """Mean actions `(B, 2 m)` and values `(B,)`."""
        both = joined(inputs, codes)
        return self._actor.forward(both).output, self._critic.forward(both).output[:, 0]

    def log_probabilities(self, actions: Array, means: Array) -> Array:
        """Logarithms `(B,)` of the densities of actions `(B, 2 m)`."""
        z = (actions - means) * np.exp(-self.log_deviation)
        return -0.5 * (z * z).sum(axis=-1) - self.log_deviation.sum() - 0.5 * math.log(2 * math.pi) * z.shape[-1]

    @property
    def entropy(self) -> float:
        """Of the distribution of actions, nats."""
        return float(self.log_deviation.sum()) + 0.5 * len(self.log_deviation) * (1 + math.log(2 * math.pi))

    def pretrain(self, sample: Sample, frames: int) -> float:
        """Behaviour cloning: mean squared error of the joint action, with codes drawn uniformly from [-1, 1].

        Args:
            frames: number of demonstrated frames, of an epoch.

        Returns:
            The mean loss of the last epoch; zero without epochs.
        """
        size = self._settings.expert_batch_size
        batches, mean_loss = max(1, frames // size), 0.0
        optimizer = Adam(self.flat, self._settings.optimizer_lr)  # only the actor has a gradient
        for _ in range(self._settings.pretrain_epochs):
            inputs, actions = sample(batches * size)
            both = joined(inputs, torch.rand((len(inputs), CODE_SIZE)).numpy() * 2 - 1)
            mean_loss = 0.0
            for start in range(0, len(inputs), size):
                rows = slice(start, start + size)
                done = self._actor.forward(both[rows])
                error = done.output - actions[rows]
                mean_loss += float(np.square(error).mean()) / batches
                self._actor.backward(done, 2 / error.size * error)
                optimizer.step()
        return mean_loss

    def improve(self, frames: Minibatch, sample: Sample) -> dict[str, float]:
        """One update of PPO, with the losses of code and inverse model in every minibatch.

        Args:
            frames: all frames of the update.
            sample: of demonstrated frames.

        Returns:
            Means over the minibatches.
        """
        settings, metrics = self._settings, []
        size, expert_size = len(frames.inputs) // settings.n_minibatches, settings.expert_batch_size
        for _ in range(settings.n_epochs):
            order = torch.randperm(len(frames.inputs)).numpy()
            expert_inputs, expert_actions = sample(settings.n_minibatches * expert_size)
            for batch in range(settings.n_minibatches):
                rows = order[batch * size : (batch + 1) * size]
                shown = slice(batch * expert_size, (batch + 1) * expert_size)
                minibatch = Minibatch(*(values[rows] for values in frames))
                metrics.append(self.add_gradient(minibatch, expert_inputs[shown], expert_actions[shown]))
                self.optimizer.step(settings.optimizer_grad_clip_norm)
        return dict(zip(_METRICS, np.mean(metrics, axis=0).tolist(), strict=True)) | {"entropy": self.entropy}

    def add_gradient(self, own: Minibatch, expert_inputs: Array, expert_actions: Array) -> tuple[float, ...]:
        """Adds the gradient of the loss of a minibatch.

        The loss is that of PPO, clipped in ratio and value, plus `code_weight` times the mean distance of the code that
        the inverse model reads in the partner's mean action from the code given, plus `inverse_weight` times the mean
        distance of the partner's demonstrated action from the actor's with the code inferred from that action.

        Returns:
            Policy loss, value loss, KL divergence, proportion of clipped ratios, code loss, inverse loss.
        """
        settings, partner, size = self._settings, self._partner, len(own.inputs)
        inference = self._inverse.forward(joined(expert_inputs, expert_actions[:, partner]))
        own_inputs = joined(own.inputs, own.codes)
        # One pass of the actor for the frames of the policy, and demonstrated frames with their inferred codes.
        acting = self._actor.forward(np.concatenate((own_inputs, joined(expert_inputs, inference.output))))
        means, expert_means = acting.output[:size], acting.output[size:]
        reading = self._inverse.forward(joined(own.inputs, means[:, partner]))
        valuing = self._critic.forward(own_inputs)

        slopes = np.zeros_like(acting.output)
        policy_loss, kl, clipped = self._add_ratio_slopes(own, means, slopes[:size])
        code_errors, code_slopes = norms_and_slopes(reading.output - own.codes)
        of_partner = slice(own.inputs.shape[1], None)
        through_code = self._inverse.backward(reading, settings.code_weight / size * code_slopes, of_partner)
        slopes[:size, partner] += through_code
        inverse_errors, inverse_slopes = norms_and_slopes(expert_means[:, partner] - expert_actions[:, partner])
        slopes[size:, partner] = settings.inverse_weight / len(expert_inputs) * inverse_slopes
        of_codes = self._actor.backward(acting, slopes, _CODE)
        assert of_codes is not None
        self._inverse.backward(inference, of_codes[size:])

        value = valuing.output[:, 0]
        change = value - own.values
        near = own.values + change.clip(-settings.clip, settings.clip)
        free, held = np.square(value - own.returns), np.square(near - own.returns)
        # Where the clipped loss is larger, it is constant, unless nothing is clipped and both are the same.
        moves = (free >= held) | (np.abs(change) <= settings.clip)
        value_slopes = settings.value_weight / size * (value - own.returns) * moves
        self._critic.backward(valuing, value_slopes[:, None])
        value_loss = 0.5 * float(np.maximum(free, held).mean())
        return policy_loss, value_loss, kl, clipped, float(code_errors.mean()), float(inverse_errors.mean())

    def _add_ratio_slopes(self, own: Minibatch, means: Array, slopes: Array) -> tuple[float, float, float]:
        """PPO's loss: adds the derivatives by the means to `slopes`, those by the deviation to the gradient."""
        settings = self._settings
        inverse_deviation = np.exp(-self.log_deviation)
        z = (own.actions - means) * inverse_deviation
        change = self.log_probabilities(own.actions, means) - own.log_probabilities
        ratio = np.exp(change)
        limited = ratio.clip(1 - settings.clip, 1 + settings.clip)
        free, held = ratio * own.advantages, limited * own.advantages
        outside = np.abs(ratio - 1) > settings.clip
        moves = (free <= held) & ~(outside & (free == held))
        by_log_probability = -free * moves / len(free)
        slopes += by_log_probability[:, None] * z * inverse_deviation
        self._deviation_gradient += (by_log_probability[:, None] * (z * z - 1)).sum(axis=0)
        self._deviation_gradient -= settings.entropy_weight
        policy_loss = -float(np.minimum(free, held).mean())
        return policy_loss, float((ratio - 1 - change).mean()), float(outside.mean())

    def state(self) -> dict[str, Any]:
        """What a resumed training needs beside the weights."""
        return self.optimizer.state()
