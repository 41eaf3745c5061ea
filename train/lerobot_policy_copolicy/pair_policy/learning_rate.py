"""Learning-rate schedule: linear warm-up, then cosine decay to a fraction of the peak at the last step."""

import math
from dataclasses import dataclass

from lerobot.optim import LRSchedulerConfig
from torch.optim import Optimizer
from torch.optim.lr_scheduler import LambdaLR


@LRSchedulerConfig.register_subclass("copolicy_cosine")
@dataclass
class WarmupCosineSchedulerConfig(LRSchedulerConfig):
    """Warm-up and cosine decay over the whole run.

    LeRobot's cosine schedules end at zero or after a fixed number of steps; this one ends at `final_lr_fraction` of the
    peak at the last step of a run of any length. With a fraction of zero it equals diffusers' "cosine".
    """

    num_warmup_steps: int | None = 1000
    final_lr_fraction: float = 0.0

    def build(self, optimizer: Optimizer, num_training_steps: int) -> LambdaLR:
        """Makes the scheduler, which is stepped after each update."""
        warmup = self.num_warmup_steps or 0

        def scale(step: int) -> float:
            if step < warmup:
                return step / warmup
            progress = (step - warmup) / max(1, num_training_steps - warmup)
            cosine = 0.5 * (1 + math.cos(math.pi * min(1.0, progress)))
            return self.final_lr_fraction + (1 - self.final_lr_fraction) * cosine

        return LambdaLR(optimizer, scale)
