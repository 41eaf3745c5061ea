"""The transformer for planning: conditioning once a plan, the diffusion step from a table, no token too many."""

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
    """What is left of a decoder layer once it knows its memory; the parts in the order in which they act."""

    norm1: Affine
    self_in: Affine  # to queries, keys and values
    self_out: Affine
    norm2: Affine
    cross_bias: Tensor
    norm3: Affine
    inner: Affine
    outer: Affine


class FastTransformer:
    """A `TransformerDenoiser` that knows the diffusion steps and the number of tokens it will be asked for.

    Three savings that change nothing but the rounding:

    - Memory tokens are encoded one by one, so those of the history are constant in a plan and that of the diffusion
      step comes from a table.
    - Cross-attention compares a key k with the query of a token x, k (Q x + q) = (k Q) x + k q, sums values and
      projects the sum. With a constant memory both projections become a part of it, and leave the loop.
    - No action sees a later one, so the actions after the last one that is wanted are not denoised.

    Attributes:
        tokens: how many tokens it denoises.
        n_heads: of the attention.
        embedding, position: of the actions, `(tokens, width)`.
        layers: the decoder.
        norm, head: after the last layer.
        causal_mask: `(tokens, tokens)`, minus infinity where a token must not look.
        rows: heads times memory tokens, what each token compares itself with in a layer.
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
        """What `denoise` reads at each index of a plan with this history, `(B, To, condition_size)`.

        The tensors are the same for all indices and are written over when the next one is asked for.
        """
        embedded = self._denoiser.condition_embedding(condition) + self._denoiser.condition_position[:, 1:]
        keys, bias, values = (
            # The step is the first token of the memory; its place is filled in at each index.
            nn.functional.pad(part, (0, 0, 1, 0))
            for part in self._absorbed(self._denoiser.condition_encoder(embedded))
        )
        scores = bias.flatten(2)[:, :, None] + self._hidden  # (n_layers, B, tokens, heads * memory)
        places = keys[:, :, :, 0], scores.unflatten(-1, (self.n_heads, -1))[..., 0], values[:, :, :, 0]
        inputs = keys.flatten(2, 3), scores, values.flatten(2, 3)

        def at(index: int) -> tuple[Tensor, ...]:
            key, score, value = (part[:, index, :, 0] for part in self._steps)
            for place, row in zip(places, (key[:, None], score[:, None, None, :, 0], value[:, None]), strict=True):
                place.copy_(row)
            return inputs

        return at

    def denoise(self, noisy_actions: Tensor, inputs: tuple[Tensor, ...]) -> Tensor:
        """One evaluation.

        Args:
            noisy_actions: `(B, tokens, action_size)`.
            inputs: of each layer, with one row for each head and memory token: what to multiply a token with for its
                score, `(n_layers, B, rows, width)`; the rest of the score, `(n_layers, B, tokens, rows)`; and what
                the row adds to the output of the attention, `(n_layers, B, rows, width)`.

        Returns:
            `(B, tokens, action_size)`, the prediction.
        """
        linear = nn.functional.linear
        tokens = linear(noisy_actions, *self.embedding) + self.position
        for layer, keys, scores, values in zip(self.layers, *inputs, strict=True):
            tokens = tokens + linear(
                self._attended(linear(_norm(tokens, layer.norm1), *layer.self_in)), *layer.self_out
            )
            seen = torch.baddbmm(scores, _norm(tokens, layer.norm2), keys.mT)
            shares = seen.unflatten(-1, (self.n_heads, -1)).softmax(dim=-1).flatten(-2)
            tokens = tokens + torch.bmm(shares, values) + layer.cross_bias
            hidden = nn.functional.gelu(linear(_norm(tokens, layer.norm3), *layer.inner))
            tokens = tokens + linear(hidden, *layer.outer)
        return linear(_norm(tokens, self.norm), *self.head)

    def _attended(self, projected: Tensor) -> Tensor:
        heads = projected.unflatten(-1, (3, self.n_heads, -1)).permute(2, 0, 3, 1, 4)  # (3, B, heads, tokens, d)
        attended = nn.functional.scaled_dot_product_attention(*heads.unbind(), attn_mask=self.causal_mask)
        return attended.transpose(1, 2).flatten(-2)

    def _absorb_projections(self) -> None:
        """The cross-attention weights of all layers side by side, because the memory is the same for all."""
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
        """Memory tokens `(B, M, width)` as the tokens of each layer see them, with the projections around them.

        Returns:
            Keys `(n_layers, B, heads, M, width)`, scores with 1 in place of width, and values as the keys.
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
    """The same matrix with the inputs as its rows in memory: for few tokens a third faster to multiply with."""
    return Affine(getattr(layer, weight).T.contiguous().T, getattr(layer, bias))


def _norm(tokens: Tensor, affine: Affine) -> Tensor:
    return nn.functional.layer_norm(tokens, tokens.shape[-1:], *affine)
