"""Settings of the diffusion co-policy."""

import logging
from dataclasses import dataclass, field
from typing import Any

from lerobot.configs import NormalizationMode, PolicyFeature, PreTrainedConfig
from lerobot.optim import AdamWConfig

from copolicy.dataset.exceptions import InvalidValueError, ShapeError, UnknownNameError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE, features_of
from copolicy.dataset.task import PairTask, get_task

from .bounds import require_bounds
from .fast.backend import AUTO, BACKENDS
from .learning_rate import WarmupCosineSchedulerConfig
from .presets import PRESETS

_CHOICES = {
    "network": ("transformer", "mlp"),
    "prediction_type": ("epsilon", "sample", "v_prediction"),
    "sampler": ("ddpm", "ddim", "dpmsolver++"),
    "planner": ("fast", "plain"),
    "backend": tuple(BACKENDS),
}
_FEATURES, _GENERIC = "observation_features", "absolute"
_SYMMETRIES = ("mirror", "permute_obstacles")


def _identity() -> dict[str, NormalizationMode]:
    return dict.fromkeys(("STATE", "ENV", "ACTION"), NormalizationMode.IDENTITY)


@PreTrainedConfig.register_subclass("copolicy")
@dataclass
class CopolicyConfig(PreTrainedConfig):
    """Settings of the diffusion co-policy, which predicts the actions of both players.

    A setting that is None takes the value of `preset`. The saved configuration has all values, so changing its `preset`
    has no effect. Features and symmetries of a preset that the task does not offer are left out.

    `normalization_mapping` is IDENTITY for all features. LeRobot puts the statistics of the current data set into the
    processors, also when a checkpoint is fine-tuned on another set; a column that is constant there (a goal, an
    obstacle) then gets huge values. Instead the policy scales by the fixed bounds of the task.

    Raises:
        UnknownNameError: the preset does not exist.
        InvalidValueError: a setting is out of range or not offered by the task.
    """

    task: str | None = None  # task that defines columns, bounds, features; default: that of the data, else the table
    preset: str = "default"  # "default", "paper" (the paper exactly) or "small" (trains on a CPU in minutes)
    past_human_action: bool = True  # condition on the human's past action (the paper's CoDP-H); false is CoDP

    n_obs_steps: int = 3  # frames of history that the policy observes, including the current one
    horizon: int = 12  # length of the sampled action sequence, from the oldest frame of the history on
    n_action_steps: int = 8  # actions executed before the next sampling, from the current frame on
    drop_n_last_frames: int | None = None  # frames at the end of an episode that start no training sample
    do_mask_loss_for_padding: bool = False  # leave actions beyond either end of the episode out of the loss

    observation_features: str | None = None  # "absolute"; for the table also "relative" and "scan" (with a range scan)
    mirror: bool | None = None  # mirror half of the training samples (for the table in y)
    permute_obstacles: bool | None = None  # shuffle the order of the obstacles in training samples
    symmetries: list[str] = field(default_factory=list)  # names of further symmetries that the task offers

    network: str | None = None  # "transformer" decoder or residual "mlp"
    n_layers: int | None = None  # decoder layers, or residual blocks of the mlp
    width: int | None = None  # size of the embedding, or of the mlp's hidden layers
    n_heads: int | None = None  # attention heads of the transformer
    feedforward_width: int | None = None  # hidden size of the transformer's feed-forward part
    attention_dropout: float | None = None  # dropout in the transformer's layers
    embedding_dropout: float | None = None  # dropout after the transformer's embeddings

    num_train_timesteps: int = 100  # diffusion steps in training
    beta_schedule: str = "squaredcos_cap_v2"  # noise schedule, by its name in diffusers
    prediction_type: str | None = None  # what the network predicts: "epsilon", "sample" or "v_prediction"
    clip_sample_range: float = 1.0  # the sample is clipped to plus and minus this at each sampling step
    sampler: str | None = None  # "ddpm", "ddim" or "dpmsolver++"
    num_inference_steps: int | None = None  # denoising steps
    initial_noise_scale: float | None = None  # standard deviation of the initial noise; below 1 favours the main mode
    planner: str = "fast"  # "fast" sampler, or "plain" with diffusers' schedulers and the same result, as a reference
    compile_model: bool = False  # train the network's layers with torch.compile, for long runs on a GPU
    backend: str = "auto"  # runs the network in inference: "torch", on a CPU "onnx" or "numba"; "auto" is the fastest

    ema: bool = True  # use an exponential moving average of the weights in inference
    ema_power: float = 0.75  # decay after n updates is 1 - (1 + n / inv_gamma) ** -power
    ema_inv_gamma: float = 1.0  # see ema_power
    ema_max_decay: float = 0.9999  # upper bound of the decay

    optimizer_lr: float | None = None  # peak learning rate of AdamW
    optimizer_weight_decay: float | None = None  # not applied to biases, norms and position embeddings
    optimizer_betas: tuple[float, float] | None = None  # AdamW's betas
    optimizer_grad_clip_norm: float | None = None  # largest gradient norm; 0 does not clip
    scheduler_warmup_steps: int | None = None  # updates over which the learning rate rises
    scheduler_final_lr_fraction: float | None = None  # learning rate of the last update, as a fraction of the peak

    fps: float | None = None  # actions per second; set from the training data
    physics: dict[str, float] | None = None  # world settings of the training episodes if equal; set from the data
    physics_mixture: dict[str, int] = field(default_factory=dict)  # episodes by world settings (JSON) if these differ
    unseen: str = ""  # properties of the training episodes that policies do not observe; set from the data

    normalization_mapping: dict[str, NormalizationMode] = field(default_factory=_identity)  # fixed, see above

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.preset not in PRESETS:
            raise UnknownNameError("preset", self.preset, PRESETS)
        self._open = {name for name in ("task", *PRESETS[self.preset]) if getattr(self, name) is None}
        self._fill(get_task() if self.task is None else get_task(self.task))

    @property
    def filled(self) -> Any:
        """`self` typed as Any: type checkers cannot know that the preset has set every optional field."""
        return self

    def use_task(self, task: PairTask) -> None:
        """Sets the task of the training data, unless the settings name one.

        Raises:
            InvalidValueError: the settings name another task, or features or symmetries that this one does not offer.
        """
        if "task" in self._open:
            self._fill(task)
        elif task.spec.name != self.task:
            raise InvalidValueError("task", f"{task.spec.name!r}, that of the data", self.task)

    def _fill(self, task: PairTask) -> None:
        """Sets the open settings for a task, and checks all settings."""
        self.task = task.spec.name
        for name in self._open - {"task"}:
            setattr(self, name, PRESETS[self.preset][name])
        from_preset = {name: problem for name, problem in self._not_offered(task).items() if name in self._open}
        for name in from_preset:
            setattr(self, name, _GENERIC if name == _FEATURES else False)
        if from_preset:
            values = ", ".join(f"{name}={value}" for name, (_, value) in from_preset.items())
            logging.info("%s", task.missing(f"{values} (preset {self.preset!r})"))
        for name, (expected, actual) in self._not_offered(task).items():
            raise InvalidValueError(name, expected, actual)
        self._validate()

    def _not_offered(self, task: PairTask) -> dict[str, tuple[str, Any]]:
        """Expected and actual values of the settings that the task does not offer."""
        offered = task.features
        problems: dict[str, tuple[str, Any]] = {}
        if self.observation_features not in (choices := (_GENERIC, *offered.encoders)):
            expected = f"{', '.join(choices)} (the task {self.task!r} offers no other features)"
            problems[_FEATURES] = expected, self.observation_features
        for name in _SYMMETRIES:
            if getattr(self, name) and name not in offered.symmetries:
                problems[name] = f"false (the task {self.task!r} has no such symmetry)", True
        if not set(self.symmetries) <= offered.symmetries.keys():
            expected = f"some of {', '.join(offered.symmetries) or 'none'} (the task {self.task!r} has no others)"
            problems["symmetries"] = expected, self.symmetries
        return problems

    @property
    def used_symmetries(self) -> frozenset[str]:
        """Names of the symmetries that augment training samples."""
        return frozenset(self.symmetries).union(name for name in _SYMMETRIES if getattr(self, name))

    def _validate(self) -> None:
        filled = self.filled
        for name, choices in _CHOICES.items():
            if getattr(self, name) not in choices:
                raise UnknownNameError(name, getattr(self, name), choices)
        require_bounds(filled)
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
        if any(mode is not NormalizationMode.IDENTITY for mode in self.normalization_mapping.values()):
            raise InvalidValueError(
                "normalization_mapping",
                "IDENTITY throughout, because the policy scales by the fixed bounds of the task",
                {kind: mode.value for kind, mode in self.normalization_mapping.items()},
            )

    @property
    def observation_keys(self) -> tuple[str, ...]:
        """Columns that the policy reads."""
        return (STATE, ENVIRONMENT_STATE, HUMAN_ACTION) if self.past_human_action else (STATE, ENVIRONMENT_STATE)

    @property
    def observation_delta_indices(self) -> list[int]:
        """Frames of the history, relative to the current one."""
        return list(range(1 - self.n_obs_steps, 1))

    @property
    def action_delta_indices(self) -> list[int]:
        """Frames of the action sequence, relative to the current one."""
        return list(range(1 - self.n_obs_steps, 1 - self.n_obs_steps + self.horizon))

    @property
    def reward_delta_indices(self) -> None:
        """The policy reads no reward."""
        return None

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

    def validate_features(self) -> None:
        """Checks that the data set or the environment has the columns of the task.

        Raises:
            InvalidValueError: a column is missing.
            ShapeError: a column has another shape.
        """
        columns = features_of(get_task(self.filled.task).spec)
        for name in self.observation_keys:
            _check_feature(name, columns[name]["shape"], self.input_features or {})
        _check_feature(ACTION, columns[ACTION]["shape"], self.output_features or {})


def _check_feature(name: str, expected: tuple[int, ...], features: dict[str, PolicyFeature]) -> None:
    if name not in features:
        raise InvalidValueError("features of the data set or environment", name, sorted(features))
    actual = tuple(features[name].shape)
    if actual != expected:
        raise ShapeError(name, expected, actual)
