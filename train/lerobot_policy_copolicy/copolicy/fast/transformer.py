"""The transformer for fast sampling: the memory is precomputed, and only the needed tokens are denoised."""

from collections.abc import Callable
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from ..denoiser_transformer import TransformerDenoiser


class Affine(NamedTuple):
    """Weight and bias of a layer."""

    weight: Tensor
    bias: Tensor


class DecoderLayer(NamedTuple):
    """A decoder layer without the projections that are precomputed with the memory, in the order of evaluation."""

    norm1: Affine
    self_in: Affine  # to queries, keys and values
    self_out: Affine
    norm2: Affine
    cross_bias: Tensor
    norm3: Affine
    inner: Affine
    outer: Affine


class FastTransformer:
    """A `TransformerDenoiser` for known diffusion steps and a number of tokens.

    Three optimisations, with equal results up to rounding:

    - Memory tokens are encoded independently, so those of the history are constant during sampling, and that of the
      diffusion step is precomputed for all steps.
    - Cross-attention multiplies a key k with the query of a token x, k (Q x + q) = (k Q) x + k q, sums values and
      projects the sum. With a constant memory both projections are applied to the memory once, outside the loop.
    - No action attends to a later one, so only the first `tokens` actions are denoised.

    Attributes:
        tokens: number of denoised tokens.
        n_heads: number of attention heads.
        embedding, position: embedding of the actions, and their positions `(tokens, width)`.
        layers: the decoder.
        norm, head: the layers after the decoder.
        causal_mask: `(tokens, tokens)`, minus infinity for later tokens.
        rows: number of heads times memory tokens.
    """

    def __init__(self, denoiser: TransformerDenoiser, timesteps: Tensor, tokens: int):
        self.tokens, self.n_heads = tokens, denoiser.n_heads
        self.embedding = _input_major(denoiser.action_embedding)
        self.position = denoiser.action_position[0, :tokens]
        self.layers = [_decoder_layer(layer) for layer in denoiser.layers]
        self.norm, self.head = _affine(denoiser.norm), _input_major(denoiser.head)
        self.causal_mask = denoiser.causal_mask[:tokens, :tokens]
        self._denoiser = denoiser
        self._hidden = denoiser.memory_mask[:tokens, None, :].expand(-1, self.n_heads, -1).flatten(1)
        self.rows = self._hidden.shape[1]
        self._absorb_projections()
        encoded = denoiser.step_embedding(timesteps) + denoiser.condition_position[0, :1]
        self._steps = self._absorbed(denoiser.condition_encoder(encoded)[:, None])  # with the steps as the batch

    def begin(self, condition: Tensor) -> Callable[[int], tuple[Tensor, ...]]:
        """Returns a function of the step's index that gives the `inputs` of `denoise` for `(B, To, condition_size)`.

        The tensors are overwritten at the next call of the function.
        """
        embedded = self._denoiser.condition_embedding(condition) + self._denoiser.condition_position[:, 1:]
        keys, bias, values = (
            # The step is the first token of the memory; its rows are filled in at each index.
            nn.functional.pad(part, (0, 0, 1, 0))
            for part in self._absorbed(self._denoiser.condition_encoder(embedded))
        )
        scores = bias.flatten(2)[:, :, None] + self._hidden  # (n_layers, B, tokens, heads * memory)
        step_rows = keys[:, :, :, 0], scores.unflatten(-1, (self.n_heads, -1))[..., 0], values[:, :, :, 0]
        inputs = keys.flatten(2, 3), scores, values.flatten(2, 3)

        def inputs_at(index: int) -> tuple[Tensor, ...]:
            key, score, value = (part[:, index, :, 0] for part in self._steps)
            for rows, new in zip(step_rows, (key[:, None], score[:, None, None, :, 0], value[:, None]), strict=True):
                rows.copy_(new)
            return inputs

        return inputs_at

    def denoise(self, noisy_actions: Tensor, inputs: tuple[Tensor, ...]) -> Tensor:
        """Evaluates the network.

        Args:
            noisy_actions: `(B, tokens, action_size)`.
            inputs: for each layer, with one row per head and memory token: keys that a token is multiplied with,
                `(n_layers, B, rows, width)`; scores to add, `(n_layers, B, tokens, rows)`; and projected values,
                `(n_layers, B, rows, width)`.

        Returns:
            `(B, tokens, action_size)`, the prediction.
        """
        linear = nn.functional.linear
        tokens = linear(noisy_actions, *self.embedding) + self.position
        for layer, keys, scores, values in zip(self.layers, *inputs, strict=True):
            tokens = tokens + linear(
                self._attended(linear(_norm(tokens, layer.norm1), *layer.self_in)), *layer.self_out
            )
            logits = torch.baddbmm(scores, _norm(tokens, layer.norm2), keys.mT)
            attention = logits.unflatten(-1, (self.n_heads, -1)).softmax(dim=-1).flatten(-2)
            tokens = tokens + torch.bmm(attention, values) + layer.cross_bias
            hidden = nn.functional.gelu(linear(_norm(tokens, layer.norm3), *layer.inner))
            tokens = tokens + linear(hidden, *layer.outer)
        return linear(_norm(tokens, self.norm), *self.head)

    def _attended(self, projected: Tensor) -> Tensor:
        heads = projected.unflatten(-1, (3, self.n_heads, -1)).permute(2, 0, 3, 1, 4)  # (3, B, heads, tokens, d)
        attended = nn.functional.scaled_dot_product_attention(*heads.unbind(), attn_mask=self.causal_mask)
        return attended.transpose(1, 2).flatten(-2)

    def _absorb_projections(self) -> None:
        """Joins the cross-attention weights of all layers, since all layers have the same memory."""
        attention: list[Any] = [layer.multihead_attn for layer in self._denoiser.layers]
        width = attention[0].embed_dim
        weights = torch.stack([part.in_proj_weight for part in attention]).unflatten(1, (3, width))
        biases = torch.stack([part.in_proj_bias for part in attention]).unflatten(1, (3, width))
        out = torch.stack([part.out_proj.weight.T for part in attention])
        heads, scale = len(attention) * self.n_heads, (width // self.n_heads) ** -0.5
        self._key_value = Affine(weights[:, 1:].transpose(0, 1).flatten(0, 2), biases[:, 1:].transpose(0, 1).flatten())
        self._query = weights[:, 0].reshape(heads, -1, width) * scale  # (n_layers * heads, d, width)
        self._query_bias = biases[:, 0].reshape(heads, -1, 1) * scale
        self._out = out.reshape(heads, -1, width)

    def _absorbed(self, memory: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Projects memory tokens `(B, M, width)` for each layer, including the query and output projections.

        Returns:
            Keys `(n_layers, B, heads, M, width)`, scores `(n_layers, B, heads, M, 1)`, and values like the keys.
        """
        projected = nn.functional.linear(memory.flatten(0, 1), *self._key_value)  # (B M, 2 n_layers width)
        key, value = projected.unflatten(-1, (2, len(self._query), -1)).permute(1, 2, 0, 3)
        parts = torch.bmm(key, self._query), torch.bmm(key, self._query_bias), torch.bmm(value, self._out)
        sizes = len(self.layers), self.n_heads, *memory.shape[:2]
        keys, scores, values = (part.view(*sizes, -1).transpose(1, 2) for part in parts)
        return keys, scores, values


def _decoder_layer(layer) -> DecoderLayer:
    inner = layer.self_attn
    return DecoderLayer(
        _affine(layer.norm1),
        _input_major(inner, "in_proj_weight", "in_proj_bias"),
        _input_major(inner.out_proj),
        _affine(layer.norm2),
        layer.multihead_attn.out_proj.bias,
        _affine(layer.norm3),
        _input_major(layer.linear1),
        _input_major(layer.linear2),
    )


def _affine(layer) -> Affine:
    return Affine(layer.weight, layer.bias)


def _input_major(layer, weight: str = "weight", bias: str = "bias") -> Affine:
    """The same matrix in column-major memory order, which is a third faster for few tokens."""
    return Affine(getattr(layer, weight).T.contiguous().T, getattr(layer, bias))


def _norm(tokens: Tensor, affine: Affine) -> Tensor:
    return nn.functional.layer_norm(tokens, tokens.shape[-1:], *affine)
