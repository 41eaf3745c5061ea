"""The observation of Co-GAIL's networks: a history of states, and the scenario."""

import torch
from torch import Tensor, nn

from copolicy.dataset.features import ENVIRONMENT_STATE, STATE, scaling_of
from copolicy.dataset.task_spec import TaskSpec


class HistoryInputs(nn.Module):
    """Encodes T frames of state history and the scenario.

    With the generic features these are all states and the scenario, scaled by the task's bounds. With an encoder of the
    task (range scan) these are its features of the current frame, and the scaled earlier states.

    Args:
        spec: of the task.
        history: T.
        encoder: of single frames, with an attribute `size`; None for the generic features.
        input_range: "unit" scales to [0, 1], "symmetric" to [-1, 1].
    """

    scale: Tensor
    offset: Tensor

    def __init__(self, spec: TaskSpec, history: int, encoder: nn.Module | None, input_range: str):
        super().__init__()
        self.encoder = encoder
        self._states, self._scenario = len(spec.state), len(spec.scenario)
        self._earlier = history - 1 if encoder is not None else history
        self.size = self._earlier * self._states + (self._scenario if encoder is None else int(encoder.size))  # pyright: ignore[reportArgumentType]
        scale, offset = (torch.from_numpy(values) for values in scaling_of(spec, (STATE, ENVIRONMENT_STATE)))
        if input_range == "unit":
            scale, offset = scale / 2, (offset + 1) / 2
        self.register_buffer("scale", scale, persistent=False)
        self.register_buffer("offset", offset, persistent=False)

    def forward(self, states: Tensor, scenarios: Tensor) -> Tensor:
        """Encodes states `(B, T, n)`, oldest first, and scenarios `(B, k)` in the task's units to `(B, size)`."""
        n = self._states
        scaled = states[:, : self._earlier] * self.scale[:n] + self.offset[:n]
        if self.encoder is None:
            last = scenarios * self.scale[n:] + self.offset[n:]
        else:
            last = self.encoder({STATE: states[:, -1], ENVIRONMENT_STATE: scenarios})
        return torch.cat((scaled.flatten(1), last), dim=1)


def first_history(states: Tensor, length: int, start: str) -> Tensor:
    """History `(B, length, n)` at the first frame: states `(B, n)` after "zeros" or copies of the "first" frame."""
    history = states[:, None].repeat(1, length, 1)
    if start == "zeros":
        history[:, :-1] = 0
    return history


def next_history(history: Tensor, states: Tensor) -> Tensor:
    """History `(B, T, n)` one frame later, with the new states `(B, n)`."""
    return torch.cat((history[:, 1:], states[:, None]), dim=1)
