"""Settings of the diffusion co-policy."""

from dataclasses import dataclass
from typing import ClassVar

from lerobot.configs import PreTrainedConfig
from lerobot.optim import AdamWConfig

from copolicy.dataset.exceptions import InvalidValueError

from ..pair_policy.bounds import FRACTION, POSITIVE, Bounds
from ..pair_policy.configuration_pair import PairPolicyConfig
from ..pair_policy.learning_rate import WarmupCosineSchedulerConfig
from .fast.backend import AUTO, BACKENDS
from .presets import PRESETS

_CHOICES = {
    "network": ("transformer", "mlp", "unet"),
    "prediction_type": ("epsilon", "sample", "v_prediction"),
    "sampler": ("ddpm", "ddim", "dpmsolver++"),
    "timestep_spacing": ("trailing", "leading"),
    "planner": ("fast", "plain"),
    "backend": tuple(BACKENDS),
}

_BOUNDS = {
    "n_obs_steps": Bounds(1),
    "drop_n_last_frames": Bounds(0),
    "n_layers": Bounds(1),
    "width": Bounds(1),
    "n_heads": Bounds(1),
    "feedforward_width": Bounds(1),
    "attention_dropout": FRACTION,
    "embedding_dropout": FRACTION,
    "down_widths": Bounds(1),
    "kernel_size": Bounds(1),
    "n_groups": Bounds(1),
    "step_width": Bounds(4),
    "num_train_timesteps": Bounds(1, 10_000),
    "clip_sample_range": POSITIVE,
    "initial_noise_scale": Bounds(0, expected="zero or more"),
    "ema_power": Bounds(0),
    "ema_inv_gamma": POSITIVE,
    "ema_max_decay": Bounds(0, 1),
    "optimizer_lr": Bounds(0),
    "optimizer_weight_decay": Bounds(0),
    "optimizer_betas": FRACTION,
    "optimizer_grad_clip_norm": Bounds(0),
    "scheduler_warmup_steps": Bounds(0),
    "scheduler_final_lr_fraction": Bounds(0, 1),
    "fps": POSITIVE,
}


@PreTrainedConfig.register_subclass("copolicy")
@dataclass
class CopolicyConfig(PairPolicyConfig):
    """Settings of the diffusion co-policy, which predicts the actions of both players; see `PairPolicyConfig`.

    Presets: "default", "paper" (the paper exactly) and "small" (trains on a CPU in minutes); with a temporal CNN as the
    network, "cnn" (that of Diffusion Policy, Chi et al., 2023, with the paper's horizons), "cnn-inpainting" (the
    training configuration of the CNN that the paper's authors released) and "cnn-small" ("small" with a smaller CNN).
    """

    presets: ClassVar = PRESETS
    choices: ClassVar = _CHOICES
    bounds: ClassVar = _BOUNDS

    past_human_action: bool | None = None  # condition on the human's past action (the paper's CoDP-H); false is CoDP

    n_obs_steps: int = 3  # frames of history that the policy observes, including the current one
    horizon: int = 12  # length of the sampled action sequence, from the oldest frame of the history on
    n_action_steps: int = 8  # actions executed before the next sampling, from the current frame on
    drop_n_last_frames: int | None = None  # frames at the end of an episode that start no training sample
    do_mask_loss_for_padding: bool = False  # leave actions beyond either end of the episode out of the loss

    network: str | None = None  # "transformer" decoder, residual "mlp", or "unet", the temporal CNN
    n_layers: int | None = None  # decoder layers, or residual blocks of the mlp
    width: int | None = None  # size of the embedding, or of the mlp's hidden layers
    n_heads: int | None = None  # attention heads of the transformer
    feedforward_width: int | None = None  # hidden size of the transformer's feed-forward part
    attention_dropout: float | None = None  # dropout in the transformer's layers
    embedding_dropout: float | None = None  # dropout after the transformer's embeddings
    down_widths: tuple[int, ...] | None = None  # channels of the unet's levels, each with half the frames of the last
    kernel_size: int = 5  # of the unet's convolutions, odd
    n_groups: int = 8  # of the unet's group normalisation
    step_width: int = 256  # size of the unet's embedding of the diffusion step
    inpainting: bool | None = None  # the unet denoises actions and observations, without another condition

    num_train_timesteps: int = 100  # diffusion steps in training
    beta_schedule: str = "squaredcos_cap_v2"  # noise schedule, by its name in diffusers
    prediction_type: str | None = None  # what the network predicts: "epsilon", "sample" or "v_prediction"
    clip_sample_range: float = 1.0  # the sample is clipped to plus and minus this at each sampling step
    sampler: str | None = None  # "ddpm", "ddim" or "dpmsolver++"
    num_inference_steps: int | None = None  # denoising steps
    timestep_spacing: str | None = None  # which training steps these are, in diffusers' words: "trailing" or "leading"
    initial_noise_scale: float | None = None  # standard deviation of the initial noise; below 1 favours the main mode
    planner: str = "fast"  # "fast" sampler, or "plain" with diffusers' schedulers and the same result (always the unet)
    compile_model: bool = False  # train the network's layers with torch.compile, for long runs on a GPU
    backend: str = "auto"  # runs the network in inference: "torch", on a CPU "onnx" or "numba"; "auto" is the fastest

    ema: bool = True  # use an exponential moving average of the weights in inference
    ema_power: float = 0.75  # decay after n updates is 1 - (1 + n / inv_gamma) ** -power
    ema_inv_gamma: float = 1.0  # see ema_power
    ema_max_decay: float = 0.9999  # upper bound of the decay

    optimizer_lr: float | None = None  # peak learning rate of AdamW
    optimizer_weight_decay: float | None = None  # applied to biases, norms and position embeddings of the unet only
    optimizer_betas: tuple[float, float] | None = None  # AdamW's betas
    optimizer_grad_clip_norm: float | None = None  # largest gradient norm; 0 does not clip
    scheduler_warmup_steps: int | None = None  # updates over which the learning rate rises
    scheduler_final_lr_fraction: float | None = None  # learning rate of the last update, as a fraction of the peak

    def _validate(self) -> None:
        filled = self.filled
        usable = self.horizon - self.n_obs_steps + 1
        if usable < 1:
            raise InvalidValueError("horizon", f"at least n_obs_steps = {self.n_obs_steps}", self.horizon)
        if not 1 <= self.n_action_steps <= usable:
            expected = f"1 to {usable} (horizon {self.horizon} - n_obs_steps {self.n_obs_steps} + 1)"
            raise InvalidValueError("n_action_steps", expected, self.n_action_steps)
        if not 1 <= filled.num_inference_steps <= self.num_train_timesteps:
            raise InvalidValueError(
                "num_inference_steps",
                f"1 to num_train_timesteps = {self.num_train_timesteps}",
                self.num_inference_steps,
            )
        if self.network == "transformer" and filled.width % filled.n_heads:
            raise InvalidValueError("width", f"a multiple of n_heads = {self.n_heads}", self.width)
        if self.backend not in (AUTO, "torch") and self.planner == "plain":
            raise InvalidValueError("backend, for planner=plain", "torch", self.backend)
        if self.network == "unet":
            self._validate_unet()
        elif self.inpainting:
            raise InvalidValueError("inpainting", f"false for network={self.network}, only the unet has it", True)

    def _validate_unet(self) -> None:
        levels, groups = len(self.filled.down_widths), self.n_groups
        if not levels or any(width % groups for width in self.filled.down_widths) or self.filled.down_widths[0] % 8:
            expected = f"multiples of n_groups = {groups}, the first one also of 8"
            raise InvalidValueError("down_widths", expected, list(self.filled.down_widths))
        if self.horizon % 2 ** (levels - 1):
            expected = f"a multiple of {2 ** (levels - 1)}, because down_widths has {levels} levels"
            raise InvalidValueError("horizon", expected, self.horizon)
        if self.kernel_size % 2 == 0:
            raise InvalidValueError("kernel_size", "an odd number", self.kernel_size)
        if self.step_width % 2:
            raise InvalidValueError("step_width", "an even number", self.step_width)
        if self.backend not in (AUTO, "torch"):
            raise InvalidValueError("backend, for network=unet", "torch", self.backend)
        if self.inpainting and self.observation_features != "absolute":
            expected = "absolute, whose values are in [-1, 1] like those of the sampler"
            raise InvalidValueError("observation_features, for inpainting", expected, self.observation_features)

    @property
    def observation_delta_indices(self) -> list[int]:
        """Frames of the history, relative to the current one; for inpainting those of the whole sequence."""
        return self.action_delta_indices if self.inpainting else list(range(1 - self.n_obs_steps, 1))

    @property
    def action_delta_indices(self) -> list[int]:
        """Frames of the action sequence, relative to the current one."""
        return list(range(1 - self.n_obs_steps, 1 - self.n_obs_steps + self.horizon))

    def get_optimizer_preset(self) -> AdamWConfig:
        """AdamW with the `optimizer_*` settings."""
        filled = self.filled
        return AdamWConfig(
            lr=filled.optimizer_lr,
            weight_decay=filled.optimizer_weight_decay,
            betas=filled.optimizer_betas,
            grad_clip_norm=filled.optimizer_grad_clip_norm,
        )

    def get_scheduler_preset(self) -> WarmupCosineSchedulerConfig:
        """Warm-up and cosine decay with the `scheduler_*` settings."""
        return WarmupCosineSchedulerConfig(self.scheduler_warmup_steps, self.filled.scheduler_final_lr_fraction)
