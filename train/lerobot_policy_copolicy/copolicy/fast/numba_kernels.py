"""Kernels of the fast networks for few rows, compiled by numba and called by `NumbaDenoiser`.

With the three tokens of one action, a step of the paper's network reads 25 MB of weights and uses each three times.
General matrix products are made for many rows and slow here: ONNX Runtime reads weights at 13 GB/s where the cache
gives 55. These kernels read packed weights in order, four outputs side by side, and multiply each with three rows. A
whole step is one call, where ONNX Runtime starts two hundred operators.

All functions that numba caches are in this file, because it checks no other file for changes: a change of the layout in
`packed_weights` needs a change in this file.
"""

import math
from contextlib import suppress
from itertools import chain
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from .packed_weights import LANES, OUTPUTS, padded_size

_ROWS = 3  # rows multiplied at once: twelve sums, three inputs and a weight fill AVX2's registers
_BYTES = 4  # of a float32

# Sums in any order and fused products, but no assumption of finite values, because masks are infinite.
_FASTMATH = {"reassoc", "contract", "nsz", "arcp", "afn"}


def _jit(function: Any) -> Any:
    compiled = njit(nogil=True, error_model="numpy", fastmath=_FASTMATH)(function)
    with suppress(RuntimeError):  # without a writable folder it compiles in each process
        compiled.enable_caching()  # pyright: ignore[reportAttributeAccessIssue]
    return compiled


def _block(rows: int) -> Any:
    """Makes `multiply(weights, inputs, outputs, chunks, input_stride, output_stride)` for a number of rows.

    It adds products to the outputs. The first three arguments are addresses: of one block of packed weights, of the
    first row of inputs, and of the block's outputs in the first row. It is written in LLVM's intermediate language,
    because numba's loops keep the four times three sums in memory instead of registers.
    """
    vector, number = ir.VectorType(ir.FloatType(), LANES), ir.FloatType()

    @intrinsic
    def multiply(context, weights, inputs, outputs, chunks, input_stride, output_stride):
        signature = types.void(*(types.intp,) * 6)

        def generate(context, builder, signature, arguments):
            weights, inputs, outputs, chunks, input_stride, output_stride = arguments

            def function(result, name, *parameters):
                function_type = ir.FunctionType(result, parameters)
                return cgutils.get_or_insert_function(builder.module, function_type, f"llvm.{name}.v{LANES}f32")

            def offset(address, count, stride):
                return builder.add(address, builder.mul(ir.Constant(address.type, count), stride))

            def pointer(address, element):
                return builder.inttoptr(address, element.as_pointer())

            def load_vector(address):
                load = builder.load(pointer(address, vector))
                load.align = _BYTES  # pyright: ignore[reportAttributeAccessIssue]
                return load

            size = weights.type
            multiply_add = function(vector, "fmuladd", vector, vector, vector)
            total = function(number, "vector.reduce.fadd", number, vector)
            zero = ir.Constant(vector, [0.0] * LANES)
            sums = [[cgutils.alloca_once(builder, vector) for _ in range(rows)] for _ in range(OUTPUTS)]
            for accumulator in chain(*sums):
                builder.store(zero, accumulator)
            with cgutils.for_range(builder, chunks) as loop:
                values = offset(inputs, LANES * _BYTES, loop.index)
                row_values = [load_vector(offset(values, row, input_stride)) for row in range(rows)]
                chunk = offset(weights, OUTPUTS * LANES * _BYTES, loop.index)
                for output in range(OUTPUTS):
                    weight = load_vector(builder.add(chunk, ir.Constant(size, output * LANES * _BYTES)))
                    for row in range(rows):
                        partial = builder.load(sums[output][row])
                        added = builder.call(multiply_add, [weight, row_values[row], partial])
                        builder.store(added, sums[output][row])
            for output in range(OUTPUTS):
                for row in range(rows):
                    address = offset(builder.add(outputs, ir.Constant(size, output * _BYTES)), row, output_stride)
                    start = builder.load(pointer(address, number))
                    parts = [start, builder.load(sums[output][row])]
                    builder.store(builder.call(total, parts, fastmath=("reassoc",)), pointer(address, number))
            return context.get_dummy_value()

        return signature, generate

    return multiply


_three_rows, _one_row = _block(_ROWS), _block(1)


_padded_size = _jit(padded_size)


@_jit
def _padded_zeros(rows, size):
    """Zeros `(rows, size)` with the size padded to whole chunks."""
    return np.zeros((rows, _padded_size(size, LANES)), np.float32)


@_jit
def _add_product(values, weight, out):
    """Adds `values @ W.T` to `out`; rows have padded length."""
    rows, chunks = values.shape[0], weight.shape[1]
    block = weight.ctypes.data
    for index in range(weight.shape[0]):
        row = 0
        while row < rows:
            source = values.ctypes.data + row * values.strides[0]
            target = out.ctypes.data + row * out.strides[0] + index * OUTPUTS * _BYTES
            if row + _ROWS <= rows:
                _three_rows(block, source, target, chunks, values.strides[0], out.strides[0])
                row += _ROWS
            else:
                _one_row(block, source, target, chunks, values.strides[0], out.strides[0])
                row += 1
        block += chunks * OUTPUTS * LANES * _BYTES


@_jit
def _linear(values, weight, bias, out):
    for row in range(out.shape[0]):
        out[row, : len(bias)] = bias
    _add_product(values, weight, out)


@_jit
def _add_linear(values, weight, bias, out):
    for row in range(out.shape[0]):
        out[row, : len(bias)] += bias
    _add_product(values, weight, out)


@_jit
def _normalise(values, weight, bias, out):
    size = len(weight)
    for row in range(values.shape[0]):
        mean = np.float32(0)
        for index in range(size):
            mean += values[row, index]
        mean /= np.float32(size)
        variance = np.float32(0)
        for index in range(size):
            variance += (values[row, index] - mean) ** 2
        scale = np.float32(1) / np.sqrt(variance / np.float32(size) + np.float32(1e-5))
        for index in range(size):
            out[row, index] = (values[row, index] - mean) * scale * weight[index] + bias[index]


def _float32(*values: float) -> tuple:
    return tuple(np.float32(value) for value in values)


# Polynomials in x squared whose quotient is erf(x) / x, highest power first; fitted to within 1.5e-8 on [0, 3.9] by
# least squares, reweighted towards the largest error.
_ERF_NUMERATOR = _float32(2.05038518e-06, 2.87457968e-04, 3.83689993e-03, 5.29669905e-02, 1.91941539e-01, 1.12837903e00)
_ERF_DENOMINATOR = _float32(3.82307582e-05, 1.18174059e-03, 1.51092511e-02, 1.14758423e-01, 5.03435538e-01, 1.0)


@_jit
def _polynomial(y, a, b, c, d, e, f):
    return ((((a * y + b) * y + c) * y + d) * y + e) * y + f


@_jit
def gelu(values):
    """Applies the exact GELU in place; `erf` is a quotient of polynomials, since the library's is slow."""
    for row in range(values.shape[0]):
        for index in range(values.shape[1]):
            value = values[row, index]
            x = min(max(value * np.float32(0.70710678), np.float32(-3.9)), np.float32(3.9))
            y = x * x
            erf = x * _polynomial(y, *_ERF_NUMERATOR) / _polynomial(y, *_ERF_DENOMINATOR)
            values[row, index] = np.float32(0.5) * value * (np.float32(1) + erf)


@_jit
def _softmax(values):
    largest = values[0]
    for index in range(1, len(values)):
        largest = max(largest, values[index])
    total = np.float32(0)
    for index in range(len(values)):
        values[index] = math.exp(values[index] - largest)
        total += values[index]
    for index in range(len(values)):
        values[index] /= total


@_jit
def _dot(first, second):
    total = np.float32(0)
    for index in range(len(first)):
        total += first[index] * second[index]
    return total


@_jit
def _add_scaled(values, scale, out):
    for index in range(len(values)):
        out[index] += scale * values[index]


@_jit
def _attend(projected, width, heads, tokens, out):
    """Causal self-attention of the tokens of each sequence, from queries, keys and values side by side."""
    size = width // heads
    scale = np.float32(1) / np.sqrt(np.float32(size))
    buffer = np.empty(tokens, np.float32)
    out[:] = 0
    for row in range(projected.shape[0]):
        first = row - row % tokens
        attention = buffer[: row - first + 1]
        for head in range(heads):
            begin, end = head * size, (head + 1) * size
            query = projected[row, begin:end]
            for index in range(len(attention)):
                attention[index] = scale * _dot(query, projected[first + index, width + begin : width + end])
            _softmax(attention)
            for index in range(len(attention)):
                values = projected[first + index, 2 * width + begin : 2 * width + end]
                _add_scaled(values, attention[index], out[row, begin:end])


@_jit
def _memory(normed, keys, scores, values, heads, tokens):
    """Cross-attention of each row to its sequence's memory, see `FastTransformer.denoise`: `(B * tokens, width)`."""
    rows, width = keys.shape[1], keys.shape[2]
    memory = rows // heads
    added = np.zeros((normed.shape[0], width), np.float32)
    attention = np.empty(rows, np.float32)
    for row in range(normed.shape[0]):
        sequence, token = row // tokens, row % tokens
        for index in range(rows):
            attention[index] = scores[sequence, token, index] + _dot(normed[row, :width], keys[sequence, index])
        for head in range(heads):
            _softmax(attention[head * memory : (head + 1) * memory])
        for index in range(rows):
            _add_scaled(values[sequence, index], attention[index], added[row])
    return added


@_jit
def transformer(noisy, embedding, position, layers, norm, head, heads, keys, scores, values):
    """Evaluates a `FastTransformer`.

    Args:
        noisy: `(B, tokens, action_size)` float32 and contiguous, as all arrays here.
        embedding: `PackedLinear` of the actions.
        position: `(tokens, width)`.
        layers: `PackedLayers`.
        norm, head: `Norm` and `PackedLinear` after the last layer.
        heads: number of attention heads.
        keys, scores, values: the memory of each layer: `(n_layers, B, rows, width)`, `(n_layers, B, tokens, rows)`
            and `(n_layers, B, rows, width)`.

    Returns:
        `(B, tokens, action_size)`.
    """
    batch, tokens, size = noisy.shape
    rows, width = batch * tokens, position.shape[1]
    actions = _padded_zeros(rows, size)
    actions[:, :size] = noisy.reshape(rows, size)
    stream, normed, attended = _padded_zeros(rows, width), _padded_zeros(rows, width), _padded_zeros(rows, width)
    projected, inner = _padded_zeros(rows, 3 * width), _padded_zeros(rows, layers.inner.bias.shape[1])
    for row in range(rows):
        stream[row, :width] = position[row % tokens]
    _add_linear(actions, embedding.weight, embedding.bias, stream)
    for index in range(keys.shape[0]):
        _normalise(stream, layers.norm1.weight[index], layers.norm1.bias[index], normed)
        _linear(normed, layers.self_in.weight[index], layers.self_in.bias[index], projected)
        _attend(projected, width, heads, tokens, attended)
        _add_linear(attended, layers.self_out.weight[index], layers.self_out.bias[index], stream)
        _normalise(stream, layers.norm2.weight[index], layers.norm2.bias[index], normed)
        memory = _memory(normed, keys[index], scores[index], values[index], heads, tokens)
        for row in range(rows):
            stream[row, :width] += memory[row] + layers.cross_bias[index]
        _normalise(stream, layers.norm3.weight[index], layers.norm3.bias[index], normed)
        _linear(normed, layers.inner.weight[index], layers.inner.bias[index], inner)
        gelu(inner)
        _add_linear(inner, layers.outer.weight[index], layers.outer.bias[index], stream)
    _normalise(stream, norm.weight, norm.bias, normed)
    prediction = _padded_zeros(rows, size)
    _linear(normed, head.weight, head.bias, prediction)
    return prediction[:, :size].copy().reshape(batch, tokens, size)


@_jit
def perceptron(noisy, actions, blocks, norm, head, history, biases):
    """Evaluates a `FastMlp`.

    Args:
        noisy: `(B, T * action_size)` float32 and contiguous, as all arrays here.
        actions: packed weight of the actions in the first layer.
        blocks: `PackedBlocks`.
        norm, head: `Norm` and `PackedLinear` after the last block.
        history: the first layer's output for the history, `(B, width)`.
        biases: `(n_layers, width)`, one bias per block.

    Returns:
        `(B, T * action_size)`.
    """
    rows, size = noisy.shape
    width = history.shape[1]
    values = _padded_zeros(rows, size)
    values[:, :size] = noisy
    stream, normed, inner = _padded_zeros(rows, width), _padded_zeros(rows, width), _padded_zeros(rows, width)
    stream[:, :width] = history
    _add_product(values, actions, stream)
    for index in range(biases.shape[0]):
        _normalise(stream, blocks.norm.weight[index], blocks.norm.bias[index], normed)
        _linear(normed, blocks.inner[index], biases[index], inner)
        for row in range(rows):
            for column in range(width):
                value = inner[row, column]
                inner[row, column] = value / (np.float32(1) + math.exp(-value))
        _add_linear(inner, blocks.outer.weight[index], blocks.outer.bias[index], stream)
    _normalise(stream, norm.weight, norm.bias, normed)
    prediction = _padded_zeros(rows, size)
    _linear(normed, head.weight, head.bias, prediction)
    return prediction[:, :size].copy()
