"""BC-LSTM-GMM: behaviour cloning of both players by an LSTM with a mixture of normal distributions."""

from collections.abc import Collection
from typing import Any, Unpack

import torch
from lerobot.policies.pretrained import ActionSelectKwargs
from torch import Tensor, nn

from copolicy.dataset.features import ACTION, STATE
from copolicy.dataset.task import PairTask
from copolicy.dataset.task_spec import TaskSpec

from ..pair_policy.modeling_frame import FramePolicy
from .configuration_bc_lstm_gmm import BcLstmGmmConfig
from .network import LayerStates, LayerWeights, RecurrentMixtureNetwork


class BcLstmGmmPolicy(FramePolicy):
    """Predicts the next joint action from the current frame and the state of an LSTM.

    As robomimic's `BC_RNN_GMM`: the loss is the negative log-likelihood over all frames of a window that starts with
    the state zero; frames beyond the end of the episode repeat its last frame and count. In execution a mode is drawn
    at every frame with the standard deviation `execution_deviation`, and the state is reset every `sequence_length` (L)
    frames. It acts by a copy of the weights, made at the first frame after `reset`.

    Mandlekar et al., "What Matters in Learning from Offline Human Demonstrations" (2021, arXiv 2108.03298).
    """

    config_class = BcLstmGmmConfig  # pyright: ignore[reportAssignmentType]
    name = "bc_lstm_gmm"  # pyright: ignore[reportAssignmentType]
    config: BcLstmGmmConfig

    def __init__(self, config: BcLstmGmmConfig, **kwargs):
        super().__init__(config, **kwargs)
        self.network = RecurrentMixtureNetwork(
            self.features.size, self._sizes[ACTION], config.width, config.n_layers, config.n_modes, config.min_deviation
        )
        self.reset()

    def _make_features(self, task: PairTask) -> Any:
        features, masked = super()._make_features(task), self.config.masked_state
        return MaskedStateFeatures(features, task.spec, masked) if masked else features

    def reset(self) -> None:
        """Resets the state of the LSTM; call it whenever the environment is reset or weights were changed."""
        self._state: LayerStates | None = None
        self._frames = 0
        self._layers: list[LayerWeights] | None = None  # copied at the first frame

    def train(self, mode: bool = True) -> "BcLstmGmmPolicy":
        """As in torch; the next action is of the weights as they are then."""
        self._layers = None
        return super().train(mode)

    def forward(self, batch: dict[str, Tensor], reduction: str = "mean") -> tuple[Tensor, dict]:
        """The training loss: negative log-likelihood of the joint actions, in nats.

        Args:
            batch: observation columns `(B, L, n)` and action `(B, L, m)` of both players.
            reduction: "mean", or "none" for one loss per sample.

        Returns:
            The loss, and an empty dict.

        Raises:
            InvalidValueError: a column is missing.
            ShapeError: a column has another shape.
            RunError: the batch has a frame of an excluded episode, or the loss of the step before is not finite.
        """
        self._layers = None  # the weights are about to change
        sample = self._training_sample(batch, self.config.sequence_length, self.config.sequence_length)
        mixture, _ = self.network(self.features(sample))
        loss = -mixture.distribution().log_prob(self.action_scale.scaled(sample[ACTION]))  # (B, L)
        loss = loss.mean() if reduction == "mean" else loss.mean(dim=1)
        if self.training:
            self._loss = loss.detach()
        return loss, {}

    @torch.no_grad()
    def select_action(self, batch: dict[str, Tensor], **kwargs: Unpack[ActionSelectKwargs]) -> Tensor:
        """The joint action of the current frame; call it once per frame.

        Args:
            batch: observation columns `(B, n)` of single frames.

        Returns:
            `(B, m)` within the bounds of the task.
        """
        if self._frames % self.config.sequence_length == 0:
            self._state = None
        self._frames += 1
        inputs = self.features(self._observation(batch, None))  # (B, size)
        if self._layers is None or self.training:
            self._layers = self.network.layer_weights()
        deviation, likeliest = self.config.execution_deviation, self.config.execution_mode == "likeliest"
        drawn, self._state = self.network.sample(inputs, self._state, deviation, self._layers, likeliest)
        return self.action_scale.physical(drawn.clamp(-1.0, 1.0))


class MaskedStateFeatures(nn.Module):
    """Features of an observation in which some elements of the state are 0.

    Attributes:
        size: number of features.
    """

    kept: Tensor

    def __init__(self, features: Any, spec: TaskSpec, masked: Collection[str]):
        super().__init__()
        self._features = features
        self.size: int = features.size
        kept = torch.tensor([float(name not in masked) for name in spec.state.names])
        self.register_buffer("kept", kept, persistent=False)

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """Encodes observation columns `(..., n)` in the units of the task to `(..., size)`."""
        return self._features({**observation, STATE: observation[STATE] * self.kept})
