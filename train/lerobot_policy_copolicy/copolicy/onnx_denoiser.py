"""The denoisers for planning as ONNX graphs, run by ONNX Runtime on one thread.

The graphs are written down here operator by operator: exporting the torch module gives the same plan but takes seven
seconds, where this takes a tenth of one.
"""

from importlib.util import find_spec
from typing import Any

import numpy as np
import torch
from torch import Tensor

from copolicy.dataset.exceptions import MissingExtraError

from .fast_mlp import FastMlp
from .fast_transformer import Affine, FastTransformer

_PACKAGES = ("onnxruntime", "onnx")
_OPSET, _IR_VERSION = 20, 10
_RUNTIME_DOMAIN = "com.microsoft"
_EPSILON = 1e-5  # of torch's layer norms


def require_onnx() -> None:
    """Checks that the packages of this backend are installed.

    Raises:
        MissingExtraError: one is not.
    """
    for package in _PACKAGES:
        if find_spec(package) is None:
            raise MissingExtraError(package, "onnx")


class OnnxDenoiser:
    """A denoiser whose steps run in ONNX Runtime; takes and gives what `denoise` of the fast networks does.

    One thread that does not spin: a second one, or one that waits busily, fights with the loop that the plan is for.
    """

    def __init__(self, denoiser: FastTransformer | FastMlp):
        require_onnx()
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        self._session = onnxruntime.InferenceSession(
            denoiser_graph(denoiser), options, providers=["CPUExecutionProvider"]
        )
        self._names = [entry.name for entry in self._session.get_inputs()]

    def denoise(self, noisy_actions: Tensor, inputs: tuple[Tensor, ...]) -> Tensor:
        """One evaluation, see `FastTransformer.denoise` and `FastMlp.denoise`."""
        tensors = zip(self._names, (noisy_actions, *inputs), strict=True)
        (prediction,) = self._session.run(None, {name: tensor.numpy() for name, tensor in tensors})
        return torch.from_numpy(prediction)


def denoiser_graph(denoiser: FastTransformer | FastMlp) -> bytes:
    """The serialized ONNX model of `denoiser.denoise`, for any batch size."""
    write = _transformer if isinstance(denoiser, FastTransformer) else _mlp
    return write(denoiser).serialized()  # pyright: ignore[reportArgumentType]


class _Graph:
    """Nodes of a graph in the order in which they are added; every value has a name."""

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

    def fused(self, operator: str, *inputs: str, **attributes: Any) -> str:
        """One of ONNX Runtime's own operators."""
        return self.add(operator, *inputs, domain=_RUNTIME_DOMAIN, **attributes)

    def product(self, value: str, layer: Any) -> str:
        return self.add("MatMul", value, self.constant(layer.weight.T))

    def linear(self, value: str, layer: Any) -> str:
        return self.add("Add", self.product(value, layer), self.constant(layer.bias))

    def add_and_norm(self, update: str, value: str, bias: Tensor, norm: Affine) -> tuple[str, str]:
        """Of `value + update + bias`: its norm, and itself."""
        constants = (self.constant(part) for part in (norm.weight, norm.bias, bias))
        normed = self.fused("SkipLayerNormalization", update, value, *constants, epsilon=_EPSILON)
        total = f"{normed}_total"
        self._nodes[-1].output.extend(["", "", total])
        return normed, total

    def norm(self, value: str, layer: Any) -> str:
        weight, bias = self.constant(layer.weight), self.constant(layer.bias)
        return self.add("LayerNormalization", value, weight, bias, axis=-1, epsilon=_EPSILON)

    def serialized(self) -> bytes:
        graph = self._helper.make_graph(self._nodes, "denoiser", self._inputs, self._outputs, self._constants)
        opset = [self._helper.make_opsetid("", _OPSET), self._helper.make_opsetid(_RUNTIME_DOMAIN, 1)]
        return self._helper.make_model(graph, opset_imports=opset, ir_version=_IR_VERSION).SerializeToString()

    def _tensor(self, name: str, shape: tuple[int | str, ...]):
        return self._helper.make_tensor_value_info(name, 1, shape)  # 1 is float32


def _transformer(denoiser: FastTransformer) -> _Graph:
    # With three tokens the matrix products are so short that starting an operator costs as much as many of them take;
    # ONNX Runtime's own fused operators need 13 a layer where the standard ones need 33.
    graph, tokens, heads = _Graph(), denoiser.tokens, denoiser.n_heads
    width, size = denoiser.embedding.weight.shape
    rows = denoiser.rows
    noisy = graph.input("noisy_actions", "batch", tokens, size)
    memory = [
        (
            graph.input(f"keys_{index}", "batch", rows, width),
            graph.input(f"scores_{index}", "batch", tokens, rows),
            graph.input(f"values_{index}", "batch", rows, width),
        )
        for index in range(len(denoiser.layers))
    ]
    by_row, rows_merged = (graph.constant([0, 0, *rest]) for rest in ([heads, -1], [rows]))

    embedded = graph.product(noisy, denoiser.embedding)
    value = graph.add("Add", embedded, graph.constant(denoiser.position + denoiser.embedding.bias))
    normed = graph.norm(value, denoiser.layers[0].norm1)
    following = [*(layer.norm1 for layer in denoiser.layers[1:]), denoiser.norm]
    for layer, norm, (keys, scores, values) in zip(denoiser.layers, following, memory, strict=True):
        weights = graph.constant(layer.self_in.weight.T), graph.constant(layer.self_in.bias)
        attended = graph.fused("Attention", normed, *weights, num_heads=heads, unidirectional=1)
        attended = graph.product(attended, layer.self_out)
        normed, value = graph.add_and_norm(attended, value, layer.self_out.bias, layer.norm2)
        seen = graph.add("Add", graph.fused("FusedMatMul", normed, keys, transB=1), scores)
        shares = graph.add("Softmax", graph.add("Reshape", seen, by_row), axis=-1)
        crossed = graph.add("MatMul", graph.add("Reshape", shares, rows_merged), values)
        normed, value = graph.add_and_norm(crossed, value, layer.cross_bias, layer.norm3)
        hidden = graph.fused("BiasGelu", graph.product(normed, layer.inner), graph.constant(layer.inner.bias))
        normed, value = graph.add_and_norm(graph.product(hidden, layer.outer), value, layer.outer.bias, norm)
    graph.output(graph.linear(normed, denoiser.head), "batch", tokens, size)
    return graph


def _mlp(denoiser: FastMlp) -> _Graph:
    graph = _Graph()
    width, size = denoiser.actions.shape
    noisy = graph.input("noisy_actions", "batch", denoiser.tokens, size // denoiser.tokens)
    history = graph.input("history", "batch", width)
    biases = [graph.input(f"bias_{index}", width) for index in range(len(denoiser.blocks))]
    flat = graph.add("Flatten", noisy, axis=1)
    hidden = graph.add("Add", graph.add("MatMul", flat, graph.constant(denoiser.actions.T)), history)
    for block, bias in zip(denoiser.blocks, biases, strict=True):
        normed = graph.norm(hidden, block.norm)
        inner = graph.add("Add", graph.add("MatMul", normed, graph.constant(block.inner.weight.T)), bias)  # pyright: ignore
        inner = graph.add("Mul", inner, graph.add("Sigmoid", inner))
        hidden = graph.add("Add", hidden, graph.linear(inner, block.outer))
    prediction = graph.linear(graph.norm(hidden, denoiser.norm), denoiser.head)
    shape = graph.constant([0, denoiser.tokens, size // denoiser.tokens])
    graph.output(graph.add("Reshape", prediction, shape), "batch", denoiser.tokens, size // denoiser.tokens)
    return graph
