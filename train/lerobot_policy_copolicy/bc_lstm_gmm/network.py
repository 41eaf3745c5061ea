"""The network of BC-RNN-GMM: an LSTM whose output is a mixture of normal distributions over the joint action."""

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.distributions import Categorical, Independent, MixtureSameFamily, Normal

State = tuple[Tensor, Tensor]
"""Hidden and cell state of the LSTM, `(layers, B, width)` each."""

LayerStates = tuple[tuple[Tensor, Tensor], ...]
"""Hidden and cell state `(B, width)` of each layer."""


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


class LayerWeights(NamedTuple):
    """Weights of an LSTM layer for its n inputs and the hidden state together: `(n + width, 4 width)`, `(4 width,)`."""

    weight: Tensor
    bias: Tensor


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
        hidden, last_state = self.lstm(inputs, state)  # (B, T, width)
        deviations = nn.functional.softplus(self.deviation(hidden)) + self.min_deviation
        return Mixture(self.logits(hidden), self._means(hidden), self._by_mode(deviations)), last_state

    @torch.no_grad()
    def layer_weights(self) -> list[LayerWeights]:
        """A copy of the weights of each layer, in the order in which `sample` reads them."""
        return [
            LayerWeights(torch.cat((inputs, hidden), dim=1).t().contiguous(), input_bias + hidden_bias)
            for inputs, hidden, input_bias, hidden_bias in self.lstm.all_weights
        ]

    @torch.no_grad()
    def sample(
        self,
        inputs: Tensor,
        state: LayerStates | None,
        deviation: float,
        layers: Sequence[LayerWeights],
        likeliest: bool = False,
    ) -> tuple[Tensor, LayerStates]:
        """Draws an action `(B, m)` for one frame `(B, input_size)`, and returns the state after it; no gradients.

        A mode is drawn, and from it an action with one standard deviation for all modes: like `forward` and
        `Mixture.distribution`, in less time. On a CPU the time is that of reading the weights: torch.lstm reorders all
        of them in each call, and a copy with the outputs side by side is read fastest.

        Args:
            inputs: of one frame, `(B, input_size)`.
            state: of each layer, from the call before; zero if None.
            deviation: standard deviation of each value, scaled to [-1, 1].
            layers: result of `layer_weights`.
            likeliest: take the likeliest mode, draw none.
        """
        if state is None:
            zeros = inputs.new_zeros(len(inputs), self.lstm.hidden_size)
            state = ((zeros, zeros),) * self.lstm.num_layers
        hidden, states = inputs, []
        for (hidden_before, cell_before), (weight, bias) in zip(state, layers, strict=True):
            gates = torch.addmm(bias, torch.cat((hidden, hidden_before), dim=-1), weight)  # (B, 4 width)
            input_gate, forget_gate, candidate, output_gate = gates.chunk(4, dim=-1)
            cell = forget_gate.sigmoid() * cell_before + input_gate.sigmoid() * candidate.tanh()
            hidden = output_gate.sigmoid() * cell.tanh()
            states.append((hidden, cell))
        logits, means = self.logits(hidden), self._means(hidden)
        mode = logits.argmax(dim=-1, keepdim=True) if likeliest else torch.multinomial(torch.softmax(logits, dim=-1), 1)
        drawn = means.gather(1, mode[:, :, None].expand(-1, 1, means.shape[-1]))[:, 0]
        return drawn + deviation * torch.randn_like(drawn), tuple(states)

    def _means(self, hidden: Tensor) -> Tensor:
        return self._by_mode(torch.tanh(self.mean(hidden)))

    def _by_mode(self, values: Tensor) -> Tensor:
        return values.unflatten(-1, (self.n_modes, self.action_size))
