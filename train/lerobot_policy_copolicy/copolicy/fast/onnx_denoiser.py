"""The fast denoisers as ONNX graphs, run by ONNX Runtime on one thread.

The graphs are built operator by operator in 0.1 s; exporting the torch module gives the same result but takes 7 s.
"""

from typing import Any

import numpy as np
import torch
from torch import Tensor

from .mlp import FastMlp
from .transformer import Affine, FastTransformer

_OPSET, _IR_VERSION = 20, 10


class OnnxDenoiser:
    """A denoiser whose steps run in ONNX Runtime, with the interface of `FastTransformer.denoise`.

    It uses one thread without busy waiting: more threads compete with the control loop for the CPU.
    """

    def __init__(self, denoiser: FastTransformer | FastMlp):
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        self._session = onnxruntime.InferenceSession(
            denoiser_graph(denoiser), options, providers=["CPUExecutionProvider"]
        )
        self._names = [entry.name for entry in self._session.get_inputs()]

    def denoise(self, noisy_actions: Tensor, inputs: tuple[Tensor, ...]) -> Tensor:
        """Evaluates the network, see `FastTransformer.denoise` and `FastMlp.denoise`."""
        tensors = zip(self._names, (noisy_actions, *_by_layer(inputs)), strict=True)
        (prediction,) = self._session.run(None, {name: tensor.numpy() for name, tensor in tensors})
        return torch.from_numpy(prediction)


def _by_layer(inputs: tuple[Tensor, ...]) -> list[Tensor]:
    """Splits a transformer's memory by layer, since slices in the graph would be copied."""
    return [part for stacked in inputs for part in (stacked.unbind() if stacked.ndim == 4 else [stacked])]


def denoiser_graph(denoiser: FastTransformer | FastMlp) -> bytes:
    """The serialized ONNX model of `denoiser.denoise`, for any batch size."""
    write = _transformer if isinstance(denoiser, FastTransformer) else _mlp
    return write(denoiser).serialized()  # pyright: ignore[reportArgumentType]


class _Graph:
    """Builder of an ONNX graph; values are referred to by name."""

    def __init__(self):
        from onnx import helper, numpy_helper

        self._helper, self._numpy = helper, numpy_helper
        self._nodes, self._constants, self._inputs, self._outputs = [], [], [], []

    def input(self, name: str, *shape: int | str) -> str:
        self._inputs.append(self._tensor(name, shape))
        return name

    def output(self, value: str, *shape: int | str) -> None:
        self._nodes.append(self._helper.make_node("Identity", [value], ["prediction"]))
        self._outputs.append(self._tensor("prediction", shape))

    def constant(self, values: Any) -> str:
        name = f"constant_{len(self._constants)}"
        array = values.detach().numpy() if isinstance(values, Tensor) else np.asarray(values)
        self._constants.append(self._numpy.from_array(np.array(array, order="C"), name))
        return name

    def add(self, operator: str, *inputs: str, **attributes: Any) -> str:
        name = f"{operator}_{len(self._nodes)}"
        self._nodes.append(self._helper.make_node(operator, inputs, [name], **attributes))
        return name

    def linear(self, value: str, layer: Any) -> str:
        return self.add("Add", self.add("MatMul", value, self.constant(layer.weight.T)), self.constant(layer.bias))

    def norm(self, value: str, layer: Any) -> str:
        weight, bias = self.constant(layer.weight), self.constant(layer.bias)
        return self.add("LayerNormalization", value, weight, bias, axis=-1, epsilon=1e-5)

    def serialized(self) -> bytes:
        graph = self._helper.make_graph(self._nodes, "denoiser", self._inputs, self._outputs, self._constants)
        opset = [self._helper.make_opsetid("", _OPSET)]
        return self._helper.make_model(graph, opset_imports=opset, ir_version=_IR_VERSION).SerializeToString()

    def _tensor(self, name: str, shape: tuple[int | str, ...]):
        return self._helper.make_tensor_value_info(name, 1, shape)  # 1 is float32


def _transformer(denoiser: FastTransformer) -> _Graph:
    graph, tokens, heads = _Graph(), denoiser.tokens, denoiser.n_heads
    width, size = denoiser.embedding.weight.shape
    rows = denoiser.rows
    noisy = graph.input("noisy_actions", "batch", tokens, size)
    shapes = {"keys": (rows, width), "scores": (tokens, rows), "values": (rows, width)}
    memory = [
        [graph.input(f"{name}_{index}", "batch", *shape) for index in range(len(denoiser.layers))]
        for name, shape in shapes.items()
    ]
    causal = graph.constant(denoiser.causal_mask)
    by_head = graph.constant([0, 0, 3, heads, width // heads])
    merged, by_row, rows_merged = (graph.constant([0, 0, *sizes]) for sizes in ([width], [heads, -1], [rows]))
    first, second, third = (graph.constant(index) for index in range(3))

    def attended(projected: str) -> str:
        split = graph.add("Transpose", graph.add("Reshape", projected, by_head), perm=[2, 0, 3, 1, 4])
        query, key, value = (graph.add("Gather", split, index, axis=0) for index in (first, second, third))
        scores = graph.add("MatMul", query, graph.add("Transpose", key, perm=[0, 1, 3, 2]))
        attention = graph.add("Softmax", graph.add("Add", scores, causal), axis=-1)
        heads_first = graph.add("MatMul", attention, value)
        return graph.add("Reshape", graph.add("Transpose", heads_first, perm=[0, 2, 1, 3]), merged)

    value = graph.add("Add", graph.linear(noisy, denoiser.embedding), graph.constant(denoiser.position))
    for layer, keys, scores, values in zip(denoiser.layers, *memory, strict=True):
        projected = graph.linear(graph.norm(value, layer.norm1), _scaled_queries(layer.self_in, width // heads))
        value = graph.add("Add", value, graph.linear(attended(projected), layer.self_out))
        logits = graph.add("MatMul", graph.norm(value, layer.norm2), graph.add("Transpose", keys, perm=[0, 2, 1]))
        logits = graph.add("Reshape", graph.add("Add", logits, scores), by_row)
        attention = graph.add("Reshape", graph.add("Softmax", logits, axis=-1), rows_merged)
        crossed = graph.add("Add", graph.add("MatMul", attention, values), graph.constant(layer.cross_bias))
        value = graph.add("Add", value, crossed)
        hidden = graph.add("Gelu", graph.linear(graph.norm(value, layer.norm3), layer.inner))
        value = graph.add("Add", value, graph.linear(hidden, layer.outer))
    graph.output(graph.linear(graph.norm(value, denoiser.norm), denoiser.head), "batch", tokens, size)
    return graph


def _scaled_queries(projection: Affine, head_size: int) -> Affine:
    """The self-attention's projection with the scale of its scores, which torch's attention applies itself."""
    scale = torch.ones(len(projection.bias))
    scale[: len(scale) // 3] = head_size**-0.5
    return Affine(projection.weight * scale[:, None], projection.bias * scale)


def _mlp(denoiser: FastMlp) -> _Graph:
    graph = _Graph()
    width, size = denoiser.actions.shape
    noisy = graph.input("noisy_actions", "batch", denoiser.tokens, size // denoiser.tokens)
    history = graph.input("history", "batch", width)
    biases = graph.input("biases", len(denoiser.blocks), width)
    flat = graph.add("Flatten", noisy, axis=1)
    hidden = graph.add("Add", graph.add("MatMul", flat, graph.constant(denoiser.actions.T)), history)
    for index, block in enumerate(denoiser.blocks):
        normed = graph.norm(hidden, block.norm)
        bias = graph.add("Gather", biases, graph.constant(index), axis=0)
        inner = graph.add("Add", graph.add("MatMul", normed, graph.constant(block.inner.weight.T)), bias)  # pyright: ignore
        inner = graph.add("Mul", inner, graph.add("Sigmoid", inner))
        hidden = graph.add("Add", hidden, graph.linear(inner, block.outer))
    prediction = graph.linear(graph.norm(hidden, denoiser.norm), denoiser.head)
    shape = graph.constant([0, denoiser.tokens, size // denoiser.tokens])
    graph.output(graph.add("Reshape", prediction, shape), "batch", denoiser.tokens, size // denoiser.tokens)
    return graph
