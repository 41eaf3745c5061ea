"""The networks of a plan as machine code for a few rows: what `NumbaDenoiser` calls.

With the three tokens of one action, a step of the paper's network is 25 MB of weights, each used three times. General
matrix products are slow there (ONNX Runtime reads them at 13 GB/s where the cache gives 55): they are made for many
rows. Here the weights lie in the order in which they are read, four outputs side by side, and each is multiplied with
three rows as it comes by; and a whole step is one call, where ONNX Runtime starts two hundred operators.

All functions that numba caches are in this file, because it looks for changes in no other: who changes the layout in
`packed_weights` changes this file with it.
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

_ROWS = 3  # multiplied at once: with four outputs, twelve sums, three inputs and a weight fill AVX2's registers
_BYTES = 4  # of a float32

# Sums in any order and fused products; but infinities stay, because the masks are made of them.
_FASTMATH = {"reassoc", "contract", "nsz", "arcp", "afn"}


def _jit(function: Any) -> Any:
    compiled = njit(nogil=True, error_model="numpy", fastmath=_FASTMATH)(function)
    with suppress(RuntimeError):  # there is no folder to write to: it compiles in each process
        compiled.enable_caching()  # pyright: ignore[reportAttributeAccessIssue]
    return compiled


def _block(rows: int) -> Any:
    """`(weights, inputs, outputs, chunks, input_stride, output_stride)`: adds products to `rows` rows of outputs.

    The first three are addresses: of one block of packed weights, of the rows of inputs, and of the block's outputs in
    the first row. Written in LLVM's terms, because compiled loops over four times three sums spill them.
    """
    vector, number = ir.VectorType(ir.FloatType(), LANES), ir.FloatType()

    @intrinsic
    def multiply(context, weights, inputs, outputs, chunks, input_stride, output_stride):
        signature = types.void(*(types.intp,) * 6)

        def generate(context, builder, signature, arguments):
            weights, inputs, outputs, chunks, input_stride, output_stride = arguments

            def function(result, name, *parameters):
                kind = ir.FunctionType(result, parameters)
                return cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f32")

            def moved(address, count, stride):
                return builder.add(address, builder.mul(ir.Constant(address.type, count), stride))

            def at(address, kind):
                return builder.inttoptr(address, kind.as_pointer())

            def loaded(address):
                load = builder.load(at(address, vector))
                load.align = _BYTES  # pyright: ignore[reportAttributeAccessIssue]
                return load

            size = weights.type
            multiply_add = function(vector, "fmuladd", vector, vector, vector)
            total = function(number, "vector.reduce.fadd", number, vector)
            zero = ir.Constant(vector, [0.0] * LANES)
            sums = [[cgutils.alloca_once(builder, vector) for _ in range(rows)] for _ in range(OUTPUTS)]
            for place in chain(*sums):
                builder.store(zero, place)
            with cgutils.for_range(builder, chunks) as loop:
                values = moved(inputs, LANES * _BYTES, loop.index)
                row_values = [loaded(moved(values, row, input_stride)) for row in range(rows)]
                chunk = moved(weights, OUTPUTS * LANES * _BYTES, loop.index)
                for output in range(OUTPUTS):
                    weight = loaded(builder.add(chunk, ir.Constant(size, output * LANES * _BYTES)))
                    for row in range(rows):
                        so_far = builder.load(sums[output][row])
                        added = builder.call(multiply_add, [weight, row_values[row], so_far])
                        builder.store(added, sums[output][row])
            for output in range(OUTPUTS):
                for row in range(rows):
                    place = moved(builder.add(outputs, ir.Constant(size, output * _BYTES)), row, output_stride)
                    start = builder.load(at(place, number))
                    parts = [start, builder.load(sums[output][row])]
                    builder.store(builder.call(total, parts, fastmath=("reassoc",)), at(place, number))
            return context.get_dummy_value()

        return signature, generate

    return multiply


_three_rows, _one_row = _block(_ROWS), _block(1)


_padded_size = _jit(padded_size)


@_jit
def _room(rows, size):
    """Zeros for rows of a size, padded to whole chunks."""
    return np.zeros((rows, _padded_size(size, LANES)), np.float32)


@_jit
def _add_product(values, weight, out):
    """Adds `values @ W.T` to `out`, for rows of padded length."""
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


# Of erf(x) / x in x squared, from the highest power down; fitted to within 1.5e-8 on [0, 3.9] by least squares,
# reweighted towards the largest error.
_ERF_ABOVE = _float32(2.05038518e-06, 2.87457968e-04, 3.83689993e-03, 5.29669905e-02, 1.91941539e-01, 1.12837903e00)
_ERF_BELOW = _float32(3.82307582e-05, 1.18174059e-03, 1.51092511e-02, 1.14758423e-01, 5.03435538e-01, 1.0)


@_jit
def _polynomial(y, a, b, c, d, e, f):
    return ((((a * y + b) * y + c) * y + d) * y + e) * y + f


@_jit
def gelu(values):
    """The exact GELU, in place.

    `erf` is a quotient of polynomials: the library's takes as long as the products.
    """
    for row in range(values.shape[0]):
        for index in range(values.shape[1]):
            value = values[row, index]
            x = min(max(value * np.float32(0.70710678), np.float32(-3.9)), np.float32(3.9))
            y = x * x
            erf = x * _polynomial(y, *_ERF_ABOVE) / _polynomial(y, *_ERF_BELOW)
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
    """Self-attention of each table's tokens, from queries, keys and values side by side; none sees a later one."""
    size = width // heads
    scale = np.float32(1) / np.sqrt(np.float32(size))
    shares = np.empty(tokens, np.float32)
    out[:] = 0
    for row in range(projected.shape[0]):
        first = row - row % tokens
        seen = shares[: row - first + 1]
        for head in range(heads):
            begin, end = head * size, (head + 1) * size
            query = projected[row, begin:end]
            for index in range(len(seen)):
                seen[index] = scale * _dot(query, projected[first + index, width + begin : width + end])
            _softmax(seen)
            for index in range(len(seen)):
                values = projected[first + index, 2 * width + begin : 2 * width + end]
                _add_scaled(values, seen[index], out[row, begin:end])


@_jit
def _memory(normed, keys, scores, values, heads, tokens):
    """What each row takes from its table's memory, see `FastTransformer.denoise`: `(B * tokens, width)`."""
    rows, width = keys.shape[1], keys.shape[2]
    memory = rows // heads
    added = np.zeros((normed.shape[0], width), np.float32)
    shares = np.empty(rows, np.float32)
    for row in range(normed.shape[0]):
        table, token = row // tokens, row % tokens
        for index in range(rows):
            shares[index] = scores[table, token, index] + _dot(normed[row, :width], keys[table, index])
        for head in range(heads):
            _softmax(shares[head * memory : (head + 1) * memory])
        for index in range(rows):
            _add_scaled(values[table, index], shares[index], added[row])
    return added


@_jit
def transformer(noisy, embedding, position, layers, norm, head, heads, keys, scores, values):
    """One evaluation of a `FastTransformer`.

    Args:
        noisy: `(B, tokens, action_size)` float32 and contiguous, as all arrays here.
        embedding: `PackedLinear` of the actions.
        position: `(tokens, width)`.
        layers: `PackedLayers`.
        norm, head: `Norm` and `PackedLinear` after the last layer.
        heads: of the attention.
        keys, scores, values: the memory of each layer: `(n_layers, B, rows, width)`, `(n_layers, B, tokens, rows)`
            and as the keys.

    Returns:
        `(B, tokens, action_size)`.
    """
    tables, tokens, size = noisy.shape
    rows, width = tables * tokens, position.shape[1]
    actions = _room(rows, size)
    actions[:, :size] = noisy.reshape(rows, size)
    stream, normed, attended = _room(rows, width), _room(rows, width), _room(rows, width)
    projected, inner = _room(rows, 3 * width), _room(rows, layers.inner.bias.shape[1])
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
    prediction = _room(rows, size)
    _linear(normed, head.weight, head.bias, prediction)
    return prediction[:, :size].copy().reshape(tables, tokens, size)


@_jit
def perceptron(noisy, actions, blocks, norm, head, history, biases):
    """One evaluation of a `FastMlp`.

    Args:
        noisy: `(B, T * action_size)` float32 and contiguous, as all arrays here.
        actions: packed weight of the actions in the first layer.
        blocks: `PackedBlocks`.
        norm, head: `Norm` and `PackedLinear` after the last block.
        history: what the first layer makes of the history, `(B, width)`.
        biases: of each block, `(n_layers, width)`.

    Returns:
        `(B, T * action_size)`.
    """
    rows, size = noisy.shape
    width = history.shape[1]
    values = _room(rows, size)
    values[:, :size] = noisy
    stream, normed, inner = _room(rows, width), _room(rows, width), _room(rows, width)
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
    prediction = _room(rows, size)
    _linear(normed, head.weight, head.bias, prediction)
    return prediction[:, :size].copy()
