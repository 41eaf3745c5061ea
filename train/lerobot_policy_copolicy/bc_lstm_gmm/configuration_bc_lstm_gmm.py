"""Settings of BC-LSTM-GMM."""

from dataclasses import dataclass, field
from typing import Any, ClassVar

from lerobot.configs import PreTrainedConfig
from lerobot.optim import AdamConfig

from copolicy.dataset.exceptions import UnknownNameError
from copolicy.dataset.task import get_task

from ..pair_policy.bounds import POSITIVE, Bounds
from ..pair_policy.configuration_pair import PairPolicyConfig
from ..pair_policy.learning_rate import WarmupCosineSchedulerConfig

# robomimic's configuration for BC-RNN on low-dimensional human data, which the co-policy paper used: raw observations.
_PAPER: dict[str, Any] = {"observation_features": "raw", "mirror": False, "permute_obstacles": False}


@PreTrainedConfig.register_subclass("bc_lstm_gmm")
@dataclass
class BcLstmGmmConfig(PairPolicyConfig):
    """Settings of BC-LSTM-GMM; the defaults are robomimic's for low-dimensional human data.

    Presets: "paper" observes raw px, as robomimic and the co-policy paper do; "normalized" scales observations to
    [-1, 1], as the baseline of Diffusion Policy; "scan" adds the range scan and the symmetries of the co-policy.
    robomimic trains 200,000 steps of batch 100.

    `fps`, `physics` and `unseen` are set from the training data; see `PairPolicyConfig` for the shared settings.
    """

    presets: ClassVar = {
        "paper": _PAPER,
        "normalized": {**_PAPER, "observation_features": "absolute"},
        "scan": {"observation_features": "scan", "mirror": True, "permute_obstacles": True},
    }
    generic_features: ClassVar = ("absolute", "raw")
    choices: ClassVar = {"execution_mode": ("drawn", "likeliest")}
    n_action_steps: ClassVar[int] = 1  # it acts frame by frame
    bounds: ClassVar = {
        "sequence_length": Bounds(1),
        "n_layers": Bounds(1),
        "width": Bounds(1),
        "n_modes": Bounds(1),
        "min_deviation": POSITIVE,
        "execution_deviation": Bounds(0),
        "optimizer_lr": Bounds(0),
        "optimizer_weight_decay": Bounds(0),
        "optimizer_grad_clip_norm": Bounds(0),
        "scheduler_final_lr_fraction": Bounds(0, 1),
        "fps": POSITIVE,
    }

    preset: str = "paper"  # "paper", "normalized" or "scan"
    # Elements of the state, by name, that read 0 in task units. Without the velocity BC knows its motion from
    # successive poses alone, and copies it less.
    masked_state: list[str] = field(default_factory=list)
    sequence_length: int = 10  # frames of a training window; in execution the LSTM's state is reset as often
    n_layers: int = 2  # layers of the LSTM
    width: int = 400  # hidden size of the LSTM
    n_modes: int = 5  # modes of the mixture
    min_deviation: float = 1e-4  # added to each standard deviation in training
    execution_mode: str = "drawn"  # mode of each action in execution: "drawn", or the "likeliest"
    execution_deviation: float = 1e-4  # standard deviation of every mode in execution
    optimizer_lr: float = 1e-4  # learning rate of Adam
    optimizer_weight_decay: float = 0.0  # weight decay of Adam
    optimizer_grad_clip_norm: float = 0.0  # largest gradient norm; 0 does not clip
    scheduler_final_lr_fraction: float = 1.0  # final learning rate of a cosine decay; 1: constant, as in robomimic

    def _validate(self) -> None:
        """The masked elements are of the task's state.

        Raises:
            UnknownNameError: the state has no such element.
        """
        names = get_task(self.filled.task).spec.state.names
        for name in self.masked_state:
            if name not in names:
                raise UnknownNameError("masked_state", name, names)

    @property
    def observation_delta_indices(self) -> list[int]:
        """Frames of a training window, from the current one on."""
        return list(range(self.sequence_length))

    @property
    def action_delta_indices(self) -> list[int]:
        """The same frames."""
        return list(range(self.sequence_length))

    def get_optimizer_preset(self) -> AdamConfig:
        """Adam with the `optimizer_*` settings."""
        return AdamConfig(
            lr=self.optimizer_lr,
            weight_decay=self.optimizer_weight_decay,
            grad_clip_norm=self.optimizer_grad_clip_norm,
        )

    def get_scheduler_preset(self) -> WarmupCosineSchedulerConfig | None:
        """Cosine decay to `scheduler_final_lr_fraction` of the learning rate; None, a constant rate, if it is 1."""
        if self.scheduler_final_lr_fraction == 1:
            return None
        return WarmupCosineSchedulerConfig(0, self.scheduler_final_lr_fraction)
