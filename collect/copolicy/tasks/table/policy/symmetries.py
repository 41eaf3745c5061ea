"""Symmetries of the table for data augmentation: mirror in y, and permutation of the obstacles.

Both act on batches in physical units, `{column: (B, T, n)}`, and leave padding (obstacles at zero) unchanged.
"""

import math

import torch
from torch import Tensor

from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE

from ..features import ACTION_NAMES, ENVIRONMENT_NAMES, STATE_NAMES
from ..map_config import MAX_OBSTACLES, WINDOW

_HEIGHT = float(WINDOW[1])
_OBSTACLES = ENVIRONMENT_NAMES.index("obstacle_0_x")
# What a mirror in y negates: y itself (about the middle of the window), and every y component, angle and spin.
_NEGATED = {
    STATE: [name in ("y", "sin_theta", "vy", "omega") for name in STATE_NAMES],
    ENVIRONMENT_STATE: [name.endswith(("_y", "_theta")) for name in ENVIRONMENT_NAMES],
    HUMAN_ACTION: [False, True],
    ACTION: [name.endswith("_fy") for name in ACTION_NAMES],
}


def mirror(batch: dict[str, Tensor], mask: Tensor) -> dict[str, Tensor]:
    """Mirrors samples in y; the window, the table and the dynamics are symmetric about the middle row of the window.

    Args:
        batch: columns `(B, T, n)`; only those of the task are touched.
        mask: `(B,)` bool, the samples to mirror.
    """
    mirrored = dict(batch)
    for key in _NEGATED.keys() & batch.keys():
        values = batch[key]
        negated = torch.where(torch.tensor(_NEGATED[key], device=values.device), -values, values)
        if key == STATE:
            negated[..., 1] += _HEIGHT
        elif key == ENVIRONMENT_STATE:
            negated[..., 2] %= 2 * math.pi
            negated[..., 1] += _HEIGHT
            negated[..., 4] += _HEIGHT
            centres = values[..., _OBSTACLES:].unflatten(-1, (MAX_OBSTACLES, 2))
            negated[..., _OBSTACLES + 1 :: 2] += _HEIGHT * (centres != 0).any(dim=-1)
        mirrored[key] = torch.where(mask[:, None, None], negated, values)
    return mirrored


def mirror_half(batch: dict[str, Tensor]) -> dict[str, Tensor]:
    """Mirrors each sample with probability 1/2."""
    state = batch[STATE]
    return mirror(batch, torch.rand(len(state), device=state.device) < 0.5)


def permute_obstacles(batch: dict[str, Tensor], generator: torch.Generator | None = None) -> dict[str, Tensor]:
    """Permutes the obstacles of each sample at random, equally in all its frames; empty slots stay last."""
    environment = batch[ENVIRONMENT_STATE]
    centres = environment[..., _OBSTACLES:].unflatten(-1, (MAX_OBSTACLES, 2))  # (B, T, 3, 2)
    empty = (centres[:, 0] == 0).all(dim=-1)  # (B, 3)
    keys = torch.rand(empty.shape, generator=generator, device=environment.device) + 2 * empty
    order = keys.argsort(dim=-1)[:, None, :, None].expand_as(centres)
    shuffled = centres.gather(2, order).flatten(-2)
    return {**batch, ENVIRONMENT_STATE: torch.cat((environment[..., :_OBSTACLES], shuffled), dim=-1)}
