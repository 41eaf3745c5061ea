"""Allowed ranges of the co-policy's numeric settings."""

import math
from typing import Any, NamedTuple

from copolicy.dataset.exceptions import InvalidValueError


class Bounds(NamedTuple):
    """Range of a finite number, and its description for error messages."""

    minimum: float
    maximum: float = math.inf
    expected: str = ""

    @property
    def text(self) -> str:
        """Description for error messages."""
        return self.expected or (
            f"at least {self.minimum:g}" if self.maximum == math.inf else f"{self.minimum:g} to {self.maximum:g}"
        )

    def contains(self, value: float) -> bool:
        """Whether a number is in the range; false for NaN and infinity."""
        return self.minimum <= value <= self.maximum and math.isfinite(value)


_TINY = math.ulp(0.0)  # excludes zero
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
    """Checks every setting of `BOUNDS` that is not None.

    Raises:
        InvalidValueError: a number is out of range, NaN or infinite.
    """
    for name, bounds in BOUNDS.items():
        value = getattr(settings, name)
        for number in value if isinstance(value, (tuple, list)) else (value,):
            if number is not None and not bounds.contains(number):
                raise InvalidValueError(name, bounds.text, value)
