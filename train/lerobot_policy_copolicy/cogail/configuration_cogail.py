"""Settings of Co-GAIL: of the policy, and of its training in the world."""

from dataclasses import dataclass
from typing import Any, ClassVar

from lerobot.configs import PreTrainedConfig
from lerobot.optim import AdamConfig

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.features import HUMAN_ACTION

from ..pair_policy.bounds import FRACTION, POSITIVE, Bounds
from ..pair_policy.configuration_pair import PairPolicyConfig

# The settings with which the co-policy paper evaluated Co-GAIL, and those of the original program (2-D game).
_PAPER: dict[str, Any] = {
    "observation_features": "absolute",
    "mirror": False,
    "permute_obstacles": False,
    "input_range": "unit",
    "history_start": "zeros",
    "code": "drawn",
    "bounded_actions": False,
    "start_frames": "first",
    "initial_deviation": 1.0,
    "reward": "logit",
    "after_success": "zero",
}
_CORRECTED: dict[str, Any] = {
    **_PAPER,
    "input_range": "symmetric",
    "history_start": "first",
    "code": "episode",
    "bounded_actions": True,
    "start_frames": "any",
    "initial_deviation": 0.3,
    "reward": "positive",
    "after_success": "demonstrated",
}


@PreTrainedConfig.register_subclass("cogail")
@dataclass
class CoGailConfig(PairPolicyConfig):
    """Settings of Co-GAIL; the defaults are the published ones, but for 60 worlds at once (published: one).

    Presets: "paper" is Co-GAIL as the co-policy paper evaluated it; "corrected" scales to [-1, 1], starts the history
    with the first frame, keeps one code an episode, shows the discriminator the actions that the world executes,
    starts training episodes at any frame of the demonstrations, explores less, and changes the reward; "scan" is
    "corrected" with the range scan and the symmetries of the co-policy.

    The published reward, the logit, is negative for most of the policy's frames, since the discriminator recognises
    them; then every end is a gain, also a collision (Kostrikov et al., ICLR 2019, on this bias). "corrected" rewards
    every frame with a positive number and values a success as if demonstrated frames followed forever, so that only
    other ends are a loss.

    The code in execution (`code`): "drawn" at every frame around one point of the grid of training codes, as the
    co-policy paper evaluated; "inferred" from the partner's last action by the inverse model, as the original Co-GAIL
    (reads `observation.human_action`); "episode", drawn once an episode as in training.

    `fps`, `physics` and `unseen` are set from the training data; see `PairPolicyConfig` for the shared settings.
    """

    presets: ClassVar = {
        "paper": _PAPER,
        "corrected": _CORRECTED,
        "scan": {**_CORRECTED, "observation_features": "scan", "mirror": True, "permute_obstacles": True},
    }
    choices: ClassVar = {
        "input_range": ("unit", "symmetric"),
        "history_start": ("zeros", "first"),
        "code": ("drawn", "inferred", "episode"),
        "start_frames": ("first", "any"),
        "reward": ("logit", "positive"),
        "after_success": ("zero", "demonstrated"),
    }
    n_action_steps: ClassVar[int] = 1  # it acts frame by frame
    frames_at_30_hz: ClassVar = {"history": 15}
    bounds: ClassVar = {
        **dict.fromkeys(("history", "width", "n_worlds", "frames_per_update", "n_epochs", "n_minibatches"), Bounds(1)),
        **dict.fromkeys(("expert_batch_size", "discriminator_passes", "first_discriminator_passes"), Bounds(1)),
        **dict.fromkeys(("pretrain_epochs", "n_first_updates"), Bounds(0)),
        **dict.fromkeys(("value_weight", "entropy_weight", "code_weight", "inverse_weight"), Bounds(0)),
        **dict.fromkeys(("gradient_penalty", "optimizer_grad_clip_norm"), Bounds(0)),
        **dict.fromkeys(("optimizer_lr", "optimizer_eps", "discriminator_lr", "clip", "initial_deviation"), POSITIVE),
        "gamma": FRACTION,
        "gae_lambda": Bounds(0, 1),
        "fps": POSITIVE,
    }

    preset: str = "paper"  # "paper", "corrected" or "scan"
    history: int = 15  # frames of state history that the networks observe
    width: int = 64  # hidden size of all networks
    input_range: str | None = None  # scale inputs to [0, 1] ("unit") or [-1, 1] ("symmetric") by the task's bounds
    history_start: str | None = None  # states before the first frame: "zeros", or copies of the "first" frame
    code: str | None = None  # code in execution: "drawn" every frame, "inferred", or one an "episode"

    # Training. Frames are those of the data set's rate; each action is held for as many steps of the world.
    n_worlds: int = 60  # worlds at once
    frames_per_update: int = 6000  # frames of all worlds together between two updates
    gamma: float = 0.99  # discount a frame
    gae_lambda: float = 0.95  # of generalised advantage estimation
    clip: float = 0.2  # of PPO's probability ratio, and of the change of the value
    n_epochs: int = 10  # passes over the frames of an update
    n_minibatches: int = 32  # minibatches of a pass
    value_weight: float = 0.5  # weight of the value loss
    entropy_weight: float = 0.0  # weight of the entropy
    optimizer_lr: float = 3e-4  # learning rate of Adam, decays to zero linearly
    optimizer_eps: float = 1e-5  # of Adam
    optimizer_grad_clip_norm: float = 0.5  # largest gradient norm
    initial_deviation: float | None = None  # initial standard deviation of each action, scaled to [-1, 1]
    start_frames: str | None = None  # episodes start at the "first" or at "any" frame of a demonstration
    pretrain_epochs: int = 30  # passes of behaviour cloning over the demonstrations before
    expert_batch_size: int = 128  # demonstrated frames of a minibatch, and batch size of the discriminator
    code_weight: float = 0.1  # weight of the loss of the code that the inverse model reads in the policy's actions
    inverse_weight: float = 0.1  # weight of the loss of the partner's action from the code of a demonstrated one
    discriminator_lr: float = 1e-3  # learning rate of the discriminator's Adam
    discriminator_passes: int = 5  # passes of the discriminator over the frames of an update
    first_discriminator_passes: int = 50  # the same in the first `n_first_updates` updates
    n_first_updates: int = 10  # updates with `first_discriminator_passes`
    gradient_penalty: float = 10.0  # weight of the discriminator's gradient penalty
    reward: str | None = None  # "logit": log D - log(1 - D); "positive": -log(1 - D), so that ending early is no gain
    after_success: str | None = None  # value after a success: "zero", or the mean reward that is "demonstrated" forever
    bounded_actions: bool | None = None  # the discriminator sees actions clipped to their bounds, as the world does

    @property
    def observation_keys(self) -> tuple[str, ...]:
        """Columns that the policy reads."""
        keys = super().observation_keys
        return (*keys, HUMAN_ACTION) if self.code == "inferred" and HUMAN_ACTION not in keys else keys

    @property
    def observation_delta_indices(self) -> None:
        """The policy keeps the history itself."""
        return None

    @property
    def action_delta_indices(self) -> None:
        """One action a frame."""
        return None

    def get_optimizer_preset(self) -> AdamConfig:
        """Adam of PPO with the `optimizer_*` settings."""
        return AdamConfig(
            lr=self.optimizer_lr, eps=self.optimizer_eps, grad_clip_norm=self.optimizer_grad_clip_norm, weight_decay=0.0
        )

    def get_scheduler_preset(self) -> None:
        """The trainer of Co-GAIL decays the learning rate itself."""
        return None

    def _validate(self) -> None:
        if self.past_human_action:
            expected = "false: cogail observes the partner's past action through its code alone (code='inferred')"
            raise InvalidValueError("past_human_action", expected, True)
        if self.frames_per_update % self.n_worlds or self.frames_per_update < self.n_minibatches:
            expected = f"a multiple of n_worlds ({self.n_worlds}), at least n_minibatches ({self.n_minibatches})"
            raise InvalidValueError("frames_per_update", expected, self.frames_per_update)
