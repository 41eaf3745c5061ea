"""One row through gated recurrent cells on top of each other (`torch.nn.GRUCell`), and back."""

from collections.abc import Sequence

import torch
from torch import Tensor


def cells_forward(cells: Sequence[Tensor], gates: Tensor, states: list[Tensor]) -> tuple[list[Tensor], list[Tensor]]:
    """The states `(B, width)` after a row.

    Args:
        cells: weight and bias of the input, and of the state, of each cell.
        gates: `(B, 3 width)` of the first cell, from its input.
        states: of each cell, before the row.

    Returns:
        The states, and what the backward pass needs of each cell: state before, reset, update, new, the state's part of
        the new gate, and state after.
    """
    width, after, kept = states[0].shape[1], list[Tensor](), list[Tensor]()
    for layer, before in enumerate(states):
        to_gates, bias, recurrent, recurrent_bias = cells[4 * layer : 4 * layer + 4]
        if layer:
            gates = torch.addmm(bias, after[-1], to_gates.t())
        own = torch.addmm(recurrent_bias, before, recurrent.t())
        reset, update = (gates[:, : 2 * width] + own[:, : 2 * width]).sigmoid_().chunk(2, dim=1)
        own_new = own[:, 2 * width :]
        new = torch.addcmul(gates[:, 2 * width :], reset, own_new).tanh_()
        after.append(torch.lerp(new, before, update))
        kept += [before, reset, update, new, own_new, after[-1]]
    return after, kept


def gate_slopes(kept: Sequence[Tensor]) -> list[tuple[Tensor, Tensor, Tensor]]:
    """Derivatives of each cell's gates, for all rows at once, from what `cells_forward` kept, `(T, B, width)` each."""
    slopes: list[tuple[Tensor, Tensor, Tensor]] = []
    for index in range(0, len(kept), 6):
        before, reset, update, new, own_new, _ = kept[index : index + 6]
        by_update = (before - new) * update * (1 - update)
        slopes.append((own_new * reset * (1 - reset), by_update, (1 - update) * (1 - new * new)))
    return slopes


def cells_backward(
    cells: Sequence[Tensor],
    kept: Sequence[Tensor],
    slopes: Sequence[tuple[Tensor, Tensor, Tensor]],
    row: int,
    d_states: list[Tensor],
) -> list[Tensor]:
    """Replaces the gradients of the states after a row by those of the states before it.

    Returns:
        Gradients `(B, 3 width)` of the gates by the input and by the state, of each cell.
    """
    d_input: Tensor | None = None
    found: list[list[Tensor]] = []
    for layer in reversed(range(len(d_states))):
        to_gates, _, recurrent, _ = cells[4 * layer : 4 * layer + 4]
        _, reset, update, *_ = kept[6 * layer : 6 * layer + 6]
        by_reset, by_update, by_new = slopes[layer]
        d_after = d_states[layer] if d_input is None else d_states[layer] + d_input
        d_new = d_after * by_new[row]
        d_both = torch.cat((d_new * by_reset[row], d_after * by_update[row]), dim=1)
        d_gates, d_own = torch.cat((d_both, d_new), dim=1), torch.cat((d_both, d_new * reset[row]), dim=1)
        d_states[layer] = torch.addmm(d_after * update[row], d_own, recurrent)
        if layer:
            d_input = d_gates @ to_gates
        found.append([d_gates, d_own])
    return [value for pair in reversed(found) for value in pair]


def products(gradient: Tensor, inputs: Tensor) -> list[Tensor]:
    """Gradients of a weight and its bias from those of the results `(N, m)` and the inputs `(N, n)`."""
    return [gradient.t() @ inputs, gradient.sum(dim=0)]
