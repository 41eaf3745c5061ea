"""The symmetries of the table, applied to training samples: mirror in y, and the order of the obstacles.

Both act on batches in physical units, `{column: (B, T, n)}`, and leave padding (obstacles at zero) where it is.
"""

import math

import torch
from torch import Tensor

from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE

from ..features import ACTION_NAMES, ENVIRONMENT_NAMES, STATE_NAMES
from ..map_config import MAX_OBSTACLES, WINDOW

_HEIGHT = float(WINDOW[1])
_OBSTACLES = ENVIRONMENT_NAMES.index("obstacle_0_x")
# What turns over when y does: y itself (about the middle of the window), and every y component, angle and spin.
_TURNED = {
    STATE: [name in ("y", "sin_theta", "vy", "omega") for name in STATE_NAMES],
    ENVIRONMENT_STATE: [name.endswith(("_y", "_theta")) for name in ENVIRONMENT_NAMES],
    HUMAN_ACTION: [False, True],
    ACTION: [name.endswith("_fy") for name in ACTION_NAMES],
}


def mirror(batch: dict[str, Tensor], chosen: Tensor) -> dict[str, Tensor]:
    """The chosen samples mirrored in y: the window, the table and the dynamics are symmetric about its middle row.

    Args:
        batch: columns `(B, T, n)`; only those of the task are touched.
        chosen: `(B,)` bool.
    """
    mirrored = dict(batch)
    for key in _TURNED.keys() & batch.keys():
        values = batch[key]
        turned = torch.where(torch.tensor(_TURNED[key], device=values.device), -values, values)
        if key == STATE:
            turned[..., 1] += _HEIGHT
        elif key == ENVIRONMENT_STATE:
            turned[..., 2] %= 2 * math.pi
            turned[..., 1] += _HEIGHT
            turned[..., 4] += _HEIGHT
            centres = values[..., _OBSTACLES:].unflatten(-1, (MAX_OBSTACLES, 2))
            turned[..., _OBSTACLES + 1 :: 2] += _HEIGHT * (centres != 0).any(dim=-1)
        mirrored[key] = torch.where(chosen[:, None, None], turned, values)
    return mirrored


def mirror_half(batch: dict[str, Tensor]) -> dict[str, Tensor]:
    """Each sample mirrored with a probability of one half."""
    state = batch[STATE]
    return mirror(batch, torch.rand(len(state), device=state.device) < 0.5)


def permute_obstacles(batch: dict[str, Tensor], generator: torch.Generator | None = None) -> dict[str, Tensor]:
    """The obstacles of each sample in a random order, the same in all its frames; empty slots stay last."""
    environment = batch[ENVIRONMENT_STATE]
    centres = environment[..., _OBSTACLES:].unflatten(-1, (MAX_OBSTACLES, 2))  # (B, T, 3, 2)
    empty = (centres[:, 0] == 0).all(dim=-1)  # (B, 3)
    keys = torch.rand(empty.shape, generator=generator, device=environment.device) + 2 * empty
    order = keys.argsort(dim=-1)[:, None, :, None].expand_as(centres)
    shuffled = centres.gather(2, order).flatten(-2)
    return {**batch, ENVIRONMENT_STATE: torch.cat((environment[..., :_OBSTACLES], shuffled), dim=-1)}
