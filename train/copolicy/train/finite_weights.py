"""Weights that a policy can be saved with or started from."""

from collections.abc import Mapping

import torch
from torch import Tensor


def non_finite_weight(state: Mapping[str, Tensor]) -> str | None:
    """The first weight that is NaN or infinite, in words; None where there is none."""
    for name, values in state.items():
        if values.is_floating_point() and not bool((finite := torch.isfinite(values)).all()):
            return f"{float(values[~finite][0])} in {name}"
    return None
