"""Dense networks with gradients by hand, on the memory of torch's weights.

The networks of Co-GAIL are so small that torch's autograd takes several times longer than the arithmetic. Here their
weights are views of one vector, on which the optimizer acts at once. Tests compare all gradients with autograd.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from copolicy.dataset.arrays import Array


class Flat:
    """The weights of modules as one vector, and their gradient.

    The modules' parameters become views of the vector, so that an update of the vector updates the modules.

    Attributes:
        values, gradient: `(P,)` float32.
    """

    def __init__(self, module: nn.Module):
        parameters = list(module.parameters())
        total = sum(parameter.numel() for parameter in parameters)
        self.values: Array = np.empty(total, np.float32)
        self.gradient: Array = np.zeros(total, np.float32)
        self._views: dict[int, tuple[Array, Array]] = {}
        start = 0
        for parameter in parameters:
            part = slice(start, start + parameter.numel())
            value, gradient = (vector[part].reshape(parameter.shape) for vector in (self.values, self.gradient))
            value[...] = parameter.detach().numpy()
            parameter.data = torch.from_numpy(value)
            self._views[id(parameter)] = value, gradient
            start = part.stop

    def of(self, parameter: Tensor) -> tuple[Array, Array]:
        """A parameter's values and gradient, as views."""
        return self._views[id(parameter)]


class Pass(NamedTuple):
    """The activations of a network for a batch: its input, hidden layers and output."""

    activations: list[Array]

    @property
    def output(self) -> Array:
        """`(B, outputs)`."""
        return self.activations[-1]


class Dense:
    """A `torch.nn.Sequential` of linear layers with `Tanh` or `ReLU` after some of them."""

    def __init__(self, network: nn.Sequential, flat: Flat):
        self.weights: list[tuple[Array, Array, Array, Array]] = []  # values and gradients of weight and bias
        self._kinds: list[type[nn.Module] | None] = []
        for layer in network:
            if isinstance(layer, nn.Linear):
                self.weights.append((*flat.of(layer.weight), *flat.of(layer.bias)))
                self._kinds.append(None)
            else:
                self._kinds[-1] = type(layer)

    def forward(self, inputs: Array) -> Pass:
        """Computes `(B, outputs)` of inputs `(B, inputs)`."""
        activations = [inputs]
        for (weight, _, bias, _), kind in zip(self.weights, self._kinds, strict=True):
            values = activations[-1] @ weight.T
            values += bias
            if kind is nn.Tanh:
                _tanh(values)
            elif kind is nn.ReLU:
                np.maximum(values, 0, out=values)
            activations.append(values)
        return Pass(activations)

    def backward(self, done: Pass, slopes: Array, of_inputs: slice | None = None) -> Array | None:
        """Adds the gradients of a loss to those of the weights.

        Args:
            slopes: `(B, outputs)` derivatives of the loss with respect to the output.
            of_inputs: columns of the input whose derivatives are returned.
        """
        for index in range(len(self.weights) - 1, -1, -1):
            weight, weight_gradient, _, bias_gradient = self.weights[index]
            output, kind = done.activations[index + 1], self._kinds[index]
            if kind is nn.Tanh:
                slopes = slopes * (1 - output * output)
            elif kind is nn.ReLU:
                slopes = slopes * (output > 0)
            weight_gradient += slopes.T @ done.activations[index]
            bias_gradient += slopes.sum(axis=0)
            if index:
                slopes = slopes @ weight
            elif of_inputs is not None:
                return slopes @ weight[:, of_inputs]
        return None


class Adam:
    """Adam (Kingma and Ba, 2015) on a `Flat` vector, as torch's with `weight_decay` zero."""

    def __init__(self, flat: Flat, lr: float, eps: float = 1e-8):
        self._flat, self.lr, self._eps = flat, lr, eps
        self._betas = 0.9, 0.999
        self._moments: tuple[Array, Array] = (np.zeros_like(flat.values), np.zeros_like(flat.values))
        self._steps = 0

    def step(self, largest_norm: float = 0.0) -> None:
        """Updates the values by the gradient, scaled to `largest_norm` if it is longer, and clears the gradient."""
        gradient = self._flat.gradient
        if largest_norm:
            norm = float(np.sqrt(gradient @ gradient))
            if norm > largest_norm:
                gradient *= largest_norm / (norm + 1e-6)
        self._steps += 1
        first, second = self._moments
        for moment, beta, observed in zip(self._moments, self._betas, (gradient, gradient * gradient), strict=True):
            moment *= beta
            moment += (1 - beta) * observed
        corrections = [1 - beta**self._steps for beta in self._betas]
        scale = np.sqrt(second)
        scale *= corrections[1] ** -0.5
        scale += self._eps
        self._flat.values -= (self.lr / corrections[0]) * first / scale
        gradient[:] = 0

    def state(self) -> dict[str, Any]:
        """Everything that a resumed training needs."""
        moments = [torch.from_numpy(moment.copy()) for moment in self._moments]
        return {"moments": moments, "steps": self._steps}

    def load(self, state: dict[str, Any]) -> None:
        """Restores `state`."""
        for moment, values in zip(self._moments, state["moments"], strict=True):
            moment[:] = values.numpy()
        self._steps = int(state["steps"])


def _tanh(values: Array) -> None:
    """Hyperbolic tangent in place, to 2e-7: numpy's own takes twice as long where it has no vector instructions."""
    np.clip(values, -10, 10, out=values)
    values *= 2
    np.exp(values, out=values)
    values += 1
    np.divide(-2, values, out=values)
    values += 1


def joined(*parts: Array) -> Array:
    """Arrays `(B, n)` beside each other."""
    return np.concatenate(parts, axis=-1)


def norms_and_slopes(differences: Array) -> tuple[Array, Array]:
    """Norms `(B,)` of vectors `(B, n)`, and their derivatives `(B, n)`, zero at zero."""
    norms = np.sqrt((differences * differences).sum(axis=1))
    return norms, differences / np.maximum(norms, 1e-12)[:, None]


def shuffled(arrays: Sequence[Array], count: int) -> list[Array]:
    """Arrays `(N, ...)` in one random order, their first `count` rows."""
    order = torch.randperm(len(arrays[0])).numpy()[:count]
    return [array[order] for array in arrays]
