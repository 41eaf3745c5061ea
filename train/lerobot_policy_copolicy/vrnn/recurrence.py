"""The recurrence of the network over observed rows, with its own backward pass, which is several times as fast.

Autograd computes the gradients of all weights at every row. Here the rows are passed once forward and once backward
with the products that the recurrence needs, and the gradient of each weight is one product over all rows.
"""

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from .network import LOG_VARIANCE


class ObservedRecurrence(torch.autograd.Function):
    """Encoder, latent variables and recurrent cells over T rows, from the state zero.

    The computation is that of `MotionNetwork.posterior`, `embed_latent` and `advance`. Inputs are the embedded rows
    `(T, B, width)`, noise `(T, B, latent)` and the weights (`MotionNetwork.recurrent_weights`); outputs are the top
    states before each row `(T, B, width)`, means and logarithms of the variances `(T, B, latent)`, embedded latent
    variables `(T, B, width)`, and the state after the last row `(layers, B, width)`.
    """

    @staticmethod
    def forward(ctx: Any, embedded: Tensor, noise: Tensor, *weights: Tensor) -> tuple[Tensor, ...]:  # pyright: ignore
        """See the class."""
        encoder, cells, width = weights[:8], _by_layer(weights[8:]), embedded.shape[2]
        first, first_bias, second, second_bias, head, head_bias, latent_weight, latent_bias = encoder
        from_rows = torch.addmm(first_bias, embedded.flatten(0, 1), first[:, :width].t()).view_as(embedded)
        first_top = first[:, width:].t()
        cell_rows = embedded.flatten(0, 1) @ cells[0][0][:, :width].t() + cells[0][1]
        cell_rows = cell_rows.view(*embedded.shape[:2], -1)
        states = [embedded.new_zeros(embedded.shape[1:]) for _ in cells]
        stored: list[list[Tensor]] = []
        for row in range(len(embedded)):
            top = states[-1]
            hidden = torch.addmm(from_rows[row], top, first_top).relu_()
            above = torch.addmm(second_bias, hidden, second.t()).relu_()
            mean, raw = torch.addmm(head_bias, above, head.t()).chunk(2, dim=1)
            log_variance = raw.clamp(-LOG_VARIANCE, LOG_VARIANCE)
            spread = noise[row] * torch.exp(0.5 * log_variance)
            sample = mean + spread
            latent = torch.addmm(latent_bias, sample, latent_weight.t()).relu_()
            kept = [top, hidden, above, mean, raw, spread, sample, latent]
            for layer, (to_gates, bias, recurrent, recurrent_bias) in enumerate(cells):
                if layer:
                    gates = torch.addmm(bias, states[layer - 1], to_gates.t())
                else:
                    gates = torch.addmm(cell_rows[row], latent, to_gates[:, width:].t())
                before = states[layer]
                own = torch.addmm(recurrent_bias, before, recurrent.t())
                reset, update = (gates[:, : 2 * width] + own[:, : 2 * width]).sigmoid_().chunk(2, dim=1)
                own_new = own[:, 2 * width :]
                new = torch.addcmul(gates[:, 2 * width :], reset, own_new).tanh_()
                states[layer] = torch.lerp(new, before, update)
                kept += [before, reset, update, new, own_new, states[layer]]
            stored.append(kept)
        columns = [torch.stack(values) for values in zip(*stored, strict=True)]
        ctx.save_for_backward(embedded, *weights, *columns)
        ctx.n_weights = len(weights)
        log_variances = columns[4].clamp(-LOG_VARIANCE, LOG_VARIANCE)
        return columns[0], columns[3], log_variances, columns[7], torch.stack(states)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:  # pyright: ignore
        """Gradients of the embedded rows and the weights."""
        embedded, *saved = ctx.saved_tensors
        weights, columns = saved[: ctx.n_weights], saved[ctx.n_weights :]
        encoder, cells, width = weights[:8], _by_layer(weights[8:]), embedded.shape[2]
        first, _, second, _, head, _, latent_weight, _ = encoder
        tops, hidden, above, _, raw, spread, samples, latents = columns[:8]
        layers = [columns[8 + 6 * layer : 14 + 6 * layer] for layer in range(len(cells))]
        d_tops, d_means, d_log_variances, d_latents, d_last = gradients
        inside = (raw > -LOG_VARIANCE) & (raw < LOG_VARIANCE)
        half_spread = 0.5 * spread
        # Derivatives of the gates by their inputs, for all rows at once.
        slopes = [
            (own * reset * (1 - reset), (before - new) * update * (1 - update), (1 - update) * (1 - new * new))
            for before, reset, update, new, own, _ in layers
        ]
        d_state = list(d_last.unbind(0))
        found: list[list[Tensor]] = []
        for row in reversed(range(len(embedded))):
            of_gates: list[list[Tensor]] = []
            d_input = torch.zeros_like(d_state[0])
            for layer in reversed(range(len(cells))):
                to_gates, _, recurrent, _ = cells[layer]
                _, resets, updates, *_ = layers[layer]
                by_reset, by_update, by_new = slopes[layer]
                d_after = d_state[layer] if layer == len(cells) - 1 else d_state[layer] + d_input
                d_new = d_after * by_new[row]
                d_both = torch.cat((d_new * by_reset[row], d_after * by_update[row]), dim=1)
                d_gates = torch.cat((d_both, d_new), dim=1)
                d_own = torch.cat((d_both, d_new * resets[row]), dim=1)
                d_state[layer] = torch.addmm(d_after * updates[row], d_own, recurrent)
                d_input = d_gates @ (to_gates if layer else to_gates[:, width:])
                of_gates.append([d_gates, d_own])
            d_latent = (d_input + d_latents[row]) * (latents[row] > 0)
            d_sample = d_latent @ latent_weight
            d_raw = (d_sample * half_spread[row] + d_log_variances[row]) * inside[row]
            d_head = torch.cat((d_sample + d_means[row], d_raw), dim=1)
            d_above = (d_head @ head) * (above[row] > 0)
            d_hidden = (d_above @ second) * (hidden[row] > 0)
            d_state[-1] = torch.addmm(d_state[-1] + d_tops[row], d_hidden, first[:, width:])
            found.append([d_hidden, d_above, d_head, d_latent, *(value for pair in of_gates for value in pair)])
        found.reverse()
        by_row = [torch.stack(values).flatten(0, 1) for values in zip(*found, strict=True)]
        d_hidden, d_above, d_head, d_latent, *of_cells = by_row
        flat = embedded.flatten(0, 1)
        inputs = [torch.cat((flat, latents.flatten(0, 1)), dim=1), *(layer[5].flatten(0, 1) for layer in layers[:-1])]
        d_weights = [
            *_products(d_hidden, torch.cat((flat, tops.flatten(0, 1)), dim=1)),
            *_products(d_above, hidden.flatten(0, 1)),
            *_products(d_head, above.flatten(0, 1)),
            *_products(d_latent, samples.flatten(0, 1)),
        ]
        of_layer = list(zip(of_cells[::2], of_cells[1::2], strict=True))[::-1]
        for layer, (d_gates, d_own) in enumerate(of_layer):
            d_weights += [*_products(d_gates, inputs[layer]), *_products(d_own, layers[layer][0].flatten(0, 1))]
        d_embedded = d_hidden @ first[:, :width] + of_layer[0][0] @ cells[0][0][:, :width]
        return d_embedded.view_as(embedded), None, *d_weights


def _by_layer(weights: Any) -> list[Any]:
    return [weights[index : index + 4] for index in range(0, len(weights), 4)]


def _products(gradient: Tensor, inputs: Tensor) -> tuple[Tensor, Tensor]:
    """Gradients of a weight and its bias from those of the results `(N, m)` and the inputs `(N, n)`."""
    return gradient.t() @ inputs, gradient.sum(dim=0)
