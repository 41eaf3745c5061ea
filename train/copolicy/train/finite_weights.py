"""Checks that the weights of a policy are finite."""

from collections.abc import Mapping

import torch
from torch import Tensor


def non_finite_weight(state: Mapping[str, Tensor]) -> str | None:
    """Describes the first weight that is NaN or infinite; None if all are finite."""
    for name, values in state.items():
        if values.is_floating_point() and not bool((finite := torch.isfinite(values)).all()):
            return f"{float(values[~finite][0])} in {name}"
    return None
