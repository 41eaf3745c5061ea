"""Between which numbers each setting of the co-policy lies."""

import math
from typing import Any, NamedTuple

from copolicy.dataset.exceptions import InvalidValueError


class Bounds(NamedTuple):
    """What a number may be, in a test that NaN fails, and in words."""

    least: float
    most: float = math.inf
    expected: str = ""

    @property
    def text(self) -> str:
        """For a message."""
        return self.expected or (
            f"at least {self.least:g}" if self.most == math.inf else f"{self.least:g} to {self.most:g}"
        )

    def hold(self, value: float) -> bool:
        """Whether a number lies between them; infinity never does."""
        return self.least <= value <= self.most and math.isfinite(value)


_TINY = math.ulp(0.0)  # so that zero itself lies outside
_BELOW_ONE = math.nextafter(1.0, 0.0)
_POSITIVE = Bounds(_TINY, expected="a number above 0")
_DROPOUT = Bounds(0, _BELOW_ONE, "0 or more and less than 1")

BOUNDS: dict[str, Bounds] = {
    "n_obs_steps": Bounds(1),
    "drop_n_last_frames": Bounds(0),
    "n_layers": Bounds(1),
    "width": Bounds(1),
    "n_heads": Bounds(1),
    "feedforward_width": Bounds(1),
    "attention_dropout": _DROPOUT,
    "embedding_dropout": _DROPOUT,
    "num_train_timesteps": Bounds(1, 10_000),
    "clip_sample_range": _POSITIVE,
    "initial_noise_scale": Bounds(0, expected="zero or more"),
    "ema_power": Bounds(0),
    "ema_inv_gamma": _POSITIVE,
    "ema_max_decay": Bounds(0, 1),
    "optimizer_lr": Bounds(0),
    "optimizer_weight_decay": Bounds(0),
    "optimizer_betas": _DROPOUT,
    "optimizer_grad_clip_norm": Bounds(0),
    "scheduler_warmup_steps": Bounds(0),
    "scheduler_final_lr_fraction": Bounds(0, 1),
    "fps": _POSITIVE,
}


def require_bounds(settings: Any) -> None:
    """Checks every setting of `BOUNDS`; one that is None is left to its preset or its data.

    Raises:
        InvalidValueError: a number outside its bounds, NaN or infinite.
    """
    for name, bounds in BOUNDS.items():
        value = getattr(settings, name)
        for number in value if isinstance(value, (tuple, list)) else (value,):
            if number is not None and not bounds.hold(number):
                raise InvalidValueError(name, bounds.text, value)
