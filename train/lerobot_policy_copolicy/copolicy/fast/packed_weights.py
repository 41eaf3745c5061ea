"""Packs weights in the memory order of `numba_kernels`."""

from typing import NamedTuple

import numpy as np
from llvmlite import binding

from copolicy.dataset.arrays import Array

# float32 values per vector register: 16 for AVX-512, else 8 (AVX2, or two registers of NEON).
LANES = 16 if binding.get_host_cpu_features().get("avx512f") else 8
OUTPUTS = 4  # outputs side by side in packed weights


class PackedLinear(NamedTuple):
    """A layer `x -> W x + b`, see `pack`.

    Attributes:
        weight: `(blocks, chunks, OUTPUTS, LANES)` float32.
        bias: `(blocks * OUTPUTS,)` float32.
    """

    weight: Array
    bias: Array


class Norm(NamedTuple):
    """Weight and bias of a layer normalisation, `(size,)` float32 each."""

    weight: Array
    bias: Array


class PackedLayers(NamedTuple):
    """The stacked decoder layers of a `FastTransformer`, in the order of evaluation."""

    norm1: Norm
    self_in: PackedLinear
    self_out: PackedLinear
    norm2: Norm
    cross_bias: Array
    norm3: Norm
    inner: PackedLinear
    outer: PackedLinear


class PackedBlocks(NamedTuple):
    """The stacked residual blocks of a `FastMlp`; the bias of `inner` depends on the step and is an input."""

    norm: Norm
    inner: Array
    outer: PackedLinear


def pack(weight: Array) -> Array:
    """Packs a weight matrix `(outputs, inputs)`, padded with zeros.

    Returns:
        `(blocks, chunks, OUTPUTS, LANES)` float32: element `[b, c, o, l]` is `weight[b * OUTPUTS + o, c * LANES + l]`.
    """
    outputs, inputs = weight.shape
    padded = np.zeros((padded_size(outputs, OUTPUTS), padded_size(inputs, LANES)), np.float32)
    padded[:outputs, :inputs] = weight
    blocks = padded.reshape(len(padded) // OUTPUTS, OUTPUTS, -1, LANES)
    return np.ascontiguousarray(blocks.transpose(0, 2, 1, 3))


def padded_size(size: int, multiple: int) -> int:
    """`size` rounded up to a multiple."""
    return -(-size // multiple) * multiple
