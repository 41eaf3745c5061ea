"""The fast denoisers in kernels compiled by numba, for small batches on one thread."""

from typing import Any

import numpy as np
import torch
from torch import Tensor

from copolicy.dataset.arrays import Array

from . import numba_kernels as kernels
from .mlp import FastMlp
from .packed_weights import Norm, PackedBlocks, PackedLayers, PackedLinear, pack
from .transformer import FastTransformer


class NumbaDenoiser:
    """A denoiser whose steps run in compiled kernels, with the interface of `FastTransformer.denoise`.

    Twice as fast as ONNX Runtime for one sequence, slower for many; see `numba_kernels`. The first evaluation compiles
    the kernels in about ten seconds; numba caches them for later processes.
    """

    def __init__(self, denoiser: FastTransformer | FastMlp):
        self._tokens = denoiser.tokens
        self._evaluate = _transformer(denoiser) if isinstance(denoiser, FastTransformer) else _perceptron(denoiser)

    def denoise(self, noisy_actions: Tensor, inputs: tuple[Tensor, ...]) -> Tensor:
        """Evaluates the network, see `FastTransformer.denoise` and `FastMlp.denoise`."""
        # For an array of another memory layout, the kernels would be compiled again.
        actions = noisy_actions.contiguous().numpy()
        return torch.from_numpy(self._evaluate(actions, *(tensor.numpy() for tensor in inputs)))


def _transformer(denoiser: FastTransformer) -> Any:
    parts = list(zip(*denoiser.layers, strict=True))
    norm1, self_in, self_out, norm2, cross_bias, norm3, inner, outer = parts
    layers = PackedLayers(
        _norm(norm1), _linear(self_in), _linear(self_out), _norm(norm2), _stacked(cross_bias), _norm(norm3),
        _linear(inner), _linear(outer),
    )  # fmt: skip
    embedding, head = _single(denoiser.embedding), _single(denoiser.head)
    position, norm = _array(denoiser.position), Norm(*map(_array, denoiser.norm))
    heads = denoiser.n_heads

    def evaluate(noisy: Array, keys: Array, scores: Array, values: Array) -> Array:
        return kernels.transformer(noisy, embedding, position, layers, norm, head, heads, keys, scores, values)

    return evaluate


def _perceptron(denoiser: FastMlp) -> Any:
    blocks: list[Any] = list(denoiser.blocks)
    packed = PackedBlocks(
        _norm([block.norm for block in blocks]),
        _packed([block.inner.weight for block in blocks]),
        _linear([block.outer for block in blocks]),
    )
    actions, head = pack(_array(denoiser.actions)), _single(denoiser.head)
    norm = Norm(_array(denoiser.norm.weight), _array(denoiser.norm.bias))

    def evaluate(noisy: Array, history: Array, biases: Array) -> Array:
        return kernels.perceptron(noisy.reshape(len(noisy), -1), actions, packed, norm, head, history, biases).reshape(
            noisy.shape
        )

    return evaluate


def _linear(layers: Any) -> PackedLinear:
    return PackedLinear(_packed([layer.weight for layer in layers]), _stacked([layer.bias for layer in layers]))


def _packed(weights: list[Tensor]) -> Array:
    return np.stack([pack(_array(weight)) for weight in weights])


def _single(layer: Any) -> PackedLinear:
    return PackedLinear(pack(_array(layer.weight)), _array(layer.bias))


def _norm(layers: Any) -> Norm:
    return Norm(_stacked([layer.weight for layer in layers]), _stacked([layer.bias for layer in layers]))


def _stacked(tensors: Any) -> Array:
    return np.stack([_array(tensor) for tensor in tensors])


def _array(tensor: Tensor) -> Array:
    return np.ascontiguousarray(tensor.detach().numpy())
