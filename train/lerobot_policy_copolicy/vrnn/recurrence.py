"""The recurrences of the network, with their own backward pass, which is several times as fast.

Autograd computes the gradients of all weights at every row. Here the rows are passed once forward and once backward
with the products that the recurrence needs, and the gradient of each weight is one product over all rows.
"""

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from .cells import cells_backward, cells_forward, gate_slopes, products
from .network import LOG_VARIANCE

_OF_CELL = 6  # tensors that `cells_forward` keeps of each cell


class ObservedRecurrence(torch.autograd.Function):
    """Encoder, latent variables and recurrent cells over T observed rows, from the state zero.

    Inputs are the embedded rows `(T, B, width)`, noise `(T, B, latent)` and the weights
    (`MotionNetwork.observed_weights`); outputs are the top states before each row `(T, B, width)`, means and logarithms
    of the variances `(T, B, latent)`, embedded latent variables `(T, B, width)`, and the state after the last row
    `(layers, B, width)`.
    """

    @staticmethod
    def forward(ctx: Any, embedded: Tensor, noise: Tensor, *weights: Tensor) -> tuple[Tensor, ...]:  # pyright: ignore
        """See the class."""
        first, first_bias, second, second_bias, head, head_bias, latent_weight, latent_bias, *cells = weights
        width, flat = embedded.shape[2], embedded.flatten(0, 1)
        # What comes from the rows themselves, for all rows at once.
        from_rows = torch.addmm(first_bias, flat, first[:, :width].t()).view_as(embedded)
        gate_rows = torch.addmm(cells[1], flat, cells[0][:, :width].t()).unflatten(0, embedded.shape[:2])
        states = [embedded.new_zeros(embedded.shape[1:]) for _ in cells[::4]]
        stored: list[list[Tensor]] = []
        for row in range(len(embedded)):
            top = states[-1]
            hidden = torch.addmm(from_rows[row], top, first[:, width:].t()).relu_()
            above = torch.addmm(second_bias, hidden, second.t()).relu_()
            kept = [top, hidden, above, *_latent(above, head, head_bias, noise[row], latent_weight, latent_bias)]
            gates = torch.addmm(gate_rows[row], kept[-1], cells[0][:, width:].t())
            states, of_cells = cells_forward(cells, gates, states)
            stored.append(kept + of_cells)
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
        first, _, second, _, head, _, latent_weight, _, *cells = weights
        tops, hidden, above, _, raw, spread, samples, latents, *of_cells = columns
        d_tops, d_means, d_log_variances, d_latents, d_last = gradients
        width, flat, slopes = embedded.shape[2], embedded.flatten(0, 1), gate_slopes(of_cells)
        inside, half_spread = raw.abs() < LOG_VARIANCE, 0.5 * spread
        d_state = list(d_last.unbind(0))
        found: list[list[Tensor]] = []
        for row in reversed(range(len(embedded))):
            of_gates = cells_backward(cells, of_cells, slopes, row, d_state)
            d_latent = (of_gates[0] @ cells[0][:, width:] + d_latents[row]) * (latents[row] > 0)
            d_sample = d_latent @ latent_weight
            d_raw = (d_sample * half_spread[row] + d_log_variances[row]) * inside[row]
            d_head = torch.cat((d_sample + d_means[row], d_raw), dim=1)
            d_above = (d_head @ head) * (above[row] > 0)
            d_hidden = (d_above @ second) * (hidden[row] > 0)
            d_state[-1] = torch.addmm(d_state[-1] + d_tops[row], d_hidden, first[:, width:])
            found.append([d_hidden, d_above, d_head, d_latent, *of_gates])
        d_hidden, d_above, d_head, d_latent, *of_gates = _joined(found)
        flat_latents = latents.flatten(0, 1)
        inputs = torch.cat((flat, flat_latents), dim=1)
        d_weights = [
            *products(d_hidden, torch.cat((flat, tops.flatten(0, 1)), dim=1)),
            *products(d_above, hidden.flatten(0, 1)),
            *products(d_head, above.flatten(0, 1)),
            *products(d_latent, samples.flatten(0, 1)),
            *_of_cells(of_gates, of_cells, inputs),
        ]
        d_embedded = d_hidden @ first[:, :width] + of_gates[0] @ cells[0][:, :width]
        return d_embedded.view_as(embedded), None, *d_weights


class PredictedRecurrence(torch.autograd.Function):
    """Prior, latent variables, decoder and recurrent cells over T rows that the network predicts itself.

    Inputs are a function from the prediction `(B, p)` of a row to the next input `(B, n)`, whose first p values are
    the prediction and whose others are constants, the state `(layers, B, width)`, noise `(T, B, latent)` and the
    weights (`MotionNetwork.predicted_weights`); the output is the predictions `(T, B, p)`.
    """

    @staticmethod
    def forward(  # pyright: ignore
        ctx: Any, next_row: Callable[[Tensor], Tensor], state: Tensor, noise: Tensor, *weights: Tensor
    ) -> Tensor:
        """See the class."""
        (first, first_bias, second, second_bias, head, head_bias, latent_weight, latent_bias) = weights[:8]
        (decoder, decoder_bias, out, out_bias, row_weight, row_bias, embed, embed_bias, *cells) = weights[8:]
        states, stored = list(state.unbind(0)), list[list[Tensor]]()
        predictions, of_rows = list[Tensor](), list[list[Tensor]]()
        differentiable = any(ctx.needs_input_grad)  # not in a plan
        for row_noise in noise:
            top = states[-1]
            hidden = torch.addmm(first_bias, top, first.t()).relu_()
            above = torch.addmm(second_bias, hidden, second.t()).relu_()
            kept = [top, hidden, above, *_latent(above, head, head_bias, row_noise, latent_weight, latent_bias)]
            both = torch.cat((kept[-1], top), dim=1)
            decoded = torch.addmm(decoder_bias, both, decoder.t()).relu_()
            predictions.append(torch.addmm(out_bias, decoded, out.t()))
            row = next_row(predictions[-1])
            if differentiable:
                stored.append([*kept, both, decoded])
            if len(predictions) == len(noise):
                break
            embedding = torch.addmm(row_bias, row, row_weight.t()).relu_()
            inputs = torch.cat((torch.addmm(embed_bias, embedding, embed.t()).relu_(), kept[-1]), dim=1)
            states, of_cells = cells_forward(cells, torch.addmm(cells[1], inputs, cells[0].t()), states)
            if differentiable:
                of_rows.append([row, embedding, inputs, *of_cells])
        if not differentiable:
            return torch.stack(predictions)
        columns = [torch.stack(values) for values in zip(*stored, strict=True)]
        inputs_of = [torch.stack(values) for values in zip(*of_rows, strict=True)]
        ctx.save_for_backward(*weights, *columns, *inputs_of)
        ctx.n_weights, ctx.n_columns, ctx.n_layers = len(weights), len(columns), len(state)
        return torch.stack(predictions)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:  # pyright: ignore
        """Gradients of the state and the weights."""
        weights, saved = ctx.saved_tensors[: ctx.n_weights], ctx.saved_tensors[ctx.n_weights :]
        columns, inputs_of = saved[: ctx.n_columns], saved[ctx.n_columns :]
        (first, _, second, _, head, _, latent_weight, _) = weights[:8]
        (decoder, _, out, _, row_weight, _, embed, _, *cells) = weights[8:]
        tops, hidden, above, _, raw, spread, samples, latents, both, decoded = columns
        rows, embeddings, inputs, *of_cells = inputs_of or [tops[:0]] * 3
        (d_predicted,) = gradients
        width, size, slopes = tops.shape[2], d_predicted.shape[2], gate_slopes(of_cells)
        inside, half_spread = raw.abs() < LOG_VARIANCE, 0.5 * spread
        d_state = [torch.zeros_like(tops[0]) for _ in range(ctx.n_layers)]
        found, found_inputs = list[list[Tensor]](), list[list[Tensor]]()
        for row in reversed(range(len(tops))):
            d_out, d_latent = d_predicted[row], torch.zeros_like(tops[0])
            if row < len(rows):
                of_gates = cells_backward(cells, of_cells, slopes, row, d_state)
                d_both = of_gates[0] @ cells[0]
                d_embed = d_both[:, :width] * (inputs[row, :, :width] > 0)
                d_latent = d_both[:, width:]
                d_embedding = (d_embed @ embed) * (embeddings[row] > 0)
                d_out = d_out + d_embedding @ row_weight[:, :size]
                found_inputs.append([d_embedding, d_embed, *of_gates])
            d_decoded = (d_out @ out) * (decoded[row] > 0)
            d_pair = d_decoded @ decoder
            d_latent = (d_latent + d_pair[:, :width]) * (latents[row] > 0)
            d_sample = d_latent @ latent_weight
            d_head = torch.cat((d_sample, d_sample * half_spread[row] * inside[row]), dim=1)
            d_above = (d_head @ head) * (above[row] > 0)
            d_hidden = (d_above @ second) * (hidden[row] > 0)
            d_state[-1] = torch.addmm(d_state[-1] + d_pair[:, width:], d_hidden, first)
            found.append([d_hidden, d_above, d_head, d_latent, d_decoded, d_out])
        of_columns = zip(_joined(found), (tops, hidden, above, samples, both, decoded), strict=True)
        d_weights = [value for pair in of_columns for value in products(pair[0], pair[1].flatten(0, 1))]
        if found_inputs:
            d_embedding, d_embed, *of_gates = _joined(found_inputs)
            d_weights += products(d_embedding, rows.flatten(0, 1)) + products(d_embed, embeddings.flatten(0, 1))
            d_weights += _of_cells(of_gates, of_cells, inputs.flatten(0, 1))
        else:
            d_weights += [torch.zeros_like(weight) for weight in weights[len(d_weights) :]]
        return None, torch.stack(d_state), None, *d_weights


def _latent(
    above: Tensor, head: Tensor, head_bias: Tensor, noise: Tensor, weight: Tensor, bias: Tensor
) -> list[Tensor]:
    """Mean, unbounded logarithm of the variance, noise in its units, sample, and embedded latent variable."""
    mean, raw = torch.addmm(head_bias, above, head.t()).chunk(2, dim=1)
    spread = noise * torch.exp(0.5 * raw.clamp(-LOG_VARIANCE, LOG_VARIANCE))
    sample = mean + spread
    return [mean, raw, spread, sample, torch.addmm(bias, sample, weight.t()).relu_()]


def _joined(found: list[list[Tensor]]) -> list[Tensor]:
    """Columns `(T B, m)` of values that were found from the last row to the first."""
    return [torch.stack(values).flatten(0, 1) for values in zip(*reversed(found), strict=True)]


def _of_cells(of_gates: list[Tensor], of_cells: list[Tensor], inputs: Tensor) -> list[Tensor]:
    """Gradients of the cells' weights, from those of their gates `(T B, 3 width)` and the input of the first cell."""
    gradients: list[Tensor] = []
    for layer in range(len(of_gates) // 2):
        before, *_, after = of_cells[_OF_CELL * layer : _OF_CELL * (layer + 1)]
        gradients += products(of_gates[2 * layer], inputs)
        gradients += products(of_gates[2 * layer + 1], before.flatten(0, 1))
        inputs = after.flatten(0, 1)
    return gradients
