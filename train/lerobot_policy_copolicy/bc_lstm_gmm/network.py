"""The network of BC-RNN-GMM: an LSTM whose output is a mixture of normal distributions over the joint action."""

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.distributions import Categorical, Independent, MixtureSameFamily, Normal

State = tuple[Tensor, Tensor]
"""Hidden and cell state of the LSTM, `(layers, B, width)` each."""


class Mixture(NamedTuple):
    """Parameters of a mixture for each frame: `(B, T, modes)` logits, `(B, T, modes, m)` means and deviations."""

    logits: Tensor
    means: Tensor
    deviations: Tensor

    def distribution(self) -> MixtureSameFamily:
        """As torch's distribution over actions `(B, T, m)`."""
        # Without torch's checks of every value: the trainer checks the loss.
        modes = Independent(Normal(self.means, self.deviations, validate_args=False), 1, validate_args=False)
        weights = Categorical(logits=self.logits, validate_args=False)
        return MixtureSameFamily(weights, modes, validate_args=False)

    def sample(self, deviation: float) -> Tensor:
        """Draws a mode and from it an action `(B, T, m)`, with one standard deviation for all modes.

        Like a sample of `distribution`, without the tensors that torch's class makes for it in each call.
        """
        weights = torch.softmax(self.logits, dim=-1)  # (B, T, modes)
        mode = torch.multinomial(weights.flatten(0, -2), 1).view(*weights.shape[:-1], 1, 1)
        means = self.means.gather(-2, mode.expand(*mode.shape[:-1], self.means.shape[-1])).squeeze(-2)
        return means + deviation * torch.randn_like(means)


class RecurrentMixtureNetwork(nn.Module):
    """robomimic 0.3's `RNNGMMActorNetwork` with its settings for BC-RNN on low-dimensional human data.

    Means pass through tanh, deviations are softplus plus `min_deviation`. It has 1,973,245 parameters for 18 inputs,
    actions of 4 values and 5 modes (Mandlekar et al., 2021, arXiv 2108.03298).

    Args:
        input_size: values of an observation.
        action_size: values of a joint action, m.
        width, n_layers: of the LSTM.
        n_modes: of the mixture.
        min_deviation: added to each standard deviation in training.
    """

    def __init__(
        self,
        input_size: int,
        action_size: int,
        width: int = 400,
        n_layers: int = 2,
        n_modes: int = 5,
        min_deviation: float = 1e-4,
    ):
        super().__init__()
        self.n_modes, self.action_size, self.min_deviation = n_modes, action_size, min_deviation
        self.lstm = nn.LSTM(input_size, width, n_layers, batch_first=True)
        self.mean = nn.Linear(width, n_modes * action_size)
        self.deviation = nn.Linear(width, n_modes * action_size)
        self.logits = nn.Linear(width, n_modes)

    def forward(self, inputs: Tensor, state: State | None = None) -> tuple[Mixture, State]:
        """Mixtures of the frames `(B, T, input_size)`, and the state after the last; a state of None is zero."""
        one_frame = inputs.shape[1] == 1 and not torch.is_grad_enabled()
        hidden, last_state = self._step(inputs, state) if one_frame else self.lstm(inputs, state)  # (B, T, width)
        shape = (self.n_modes, self.action_size)
        means = torch.tanh(self.mean(hidden)).unflatten(-1, shape)
        deviations = nn.functional.softplus(self.deviation(hidden)).unflatten(-1, shape) + self.min_deviation
        return Mixture(self.logits(hidden), means, deviations), last_state

    def _step(self, inputs: Tensor, state: State | None) -> tuple[Tensor, State]:
        """As `self.lstm` for one frame `(B, 1, input_size)`; on a CPU torch.lstm reorders all weights in each call."""
        hidden, lstm = inputs[:, 0], self.lstm
        if state is None:
            zeros = hidden.new_zeros(lstm.num_layers, len(hidden), lstm.hidden_size)
            state = (zeros, zeros)
        states = []
        for layer in range(lstm.num_layers):
            before = (state[0][layer], state[1][layer])
            states.append(torch.lstm_cell(hidden, before, *lstm.all_weights[layer]))
            hidden = states[-1][0]
        h, c = zip(*states, strict=True)
        return hidden[:, None], (torch.stack(h), torch.stack(c))
