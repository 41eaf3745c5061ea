"""Settings of the VRNN planner."""

from dataclasses import dataclass
from typing import ClassVar

from lerobot.configs import PreTrainedConfig
from lerobot.optim import AdamConfig

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import get_task

from ..pair_policy.bounds import POSITIVE, Bounds
from ..pair_policy.configuration_pair import PairPolicyConfig
from ..pair_policy.learning_rate import WarmupCosineSchedulerConfig
from .presets import PRESETS

_COUNT = Bounds(1)


@PreTrainedConfig.register_subclass("vrnn")
@dataclass
class VrnnConfig(PairPolicyConfig):
    """Settings of the VRNN planner of body motion (Ng et al., "It Takes Two", ICRA 2023).

    Presets: "default" is the method with its defects corrected and its inputs, goal and obstacles as numbers; "scan"
    has the range scan and the symmetries of the co-policy as well; "paper" has the published settings, with the defects
    that shaped the published behaviour (each is a setting below).

    Settings in frames count frames of the training data. Controllers use seconds (`fps`), so that other rates than the
    30 Hz of the published settings work with frames chosen accordingly.

    Of the known defects of the published program these, among others, are not reproduced: its loader read the first 30
    files only, the divergence beyond the history used an old encoder output, a checkpoint of stride 5 ran at stride 1,
    the validation loss chose the epoch, and the human's wrench, numerically negligible, was subtracted from the plan's.
    See train/docs/rivals.md for all.

    `fps`, `physics`, `unseen` and `kl_steps` are set from the training; see `PairPolicyConfig` for shared settings.
    """

    presets: ClassVar = PRESETS
    generic_features: ClassVar = ("points",)
    frames_at_30_hz: ClassVar = {"history_frames": 30}
    choices: ClassVar = {
        "motion_axes": ("body", "scene"),
        "predicted": ("motion", "row"),
        "loss_balance": ("frame", "published"),
        "controller": ("velocity", "proportional"),
    }
    n_action_steps: ClassVar[int] = 1  # it acts frame by frame
    bounds: ClassVar = {
        "stride": _COUNT,
        "history_frames": _COUNT,
        "window_frames": _COUNT,
        "encoded_frames": _COUNT,
        "plan_frames": _COUNT,
        "lookahead_frames": _COUNT,
        "replan_frames": _COUNT,
        "n_samples": _COUNT,
        "temperature": Bounds(0),
        "latent": _COUNT,
        "width": _COUNT,
        "n_layers": _COUNT,
        "motion_deviation": POSITIVE,
        "kl_cycles": _COUNT,
        "kl_ramp": Bounds(0, 1),
        "kl_steps": _COUNT,
        "proportional_gain": POSITIVE,
        "optimizer_lr": Bounds(0),
        "optimizer_weight_decay": Bounds(0),
        "optimizer_grad_clip_norm": Bounds(0),
        "scheduler_warmup_steps": Bounds(0),
        "scheduler_final_lr_fraction": Bounds(0, 1),
        "fps": POSITIVE,
    }

    history_frames: int = 30  # frames before the current one that a plan is made from
    window_frames: int | None = None  # frames of a training window: the history, and the motion after it
    stride: int | None = None  # frames between two rows of motion
    encoded_frames: int | None = None  # frames of a window whose latent variables are the encoder's; then the prior's
    plan_frames: int | None = None  # frames that a plan predicts
    lookahead_frames: int | None = None  # frames from the plan's start to the waypoint that the controller drives to
    replan_frames: int = 2  # frames between two plans
    n_samples: int = 16  # sampled plans, of which the one with the greatest sum of rewards is executed
    temperature: float = 1.0  # factor of the prior's standard deviations in sampled plans

    latent: int = 6  # values of the latent variable of a row
    width: int = 64  # hidden size of all layers
    n_layers: int = 2  # layers of the GRU

    observe_pose: bool | None = None  # for the features "points": the body's own pose too, which tells of walls
    motion_axes: str | None = None  # axes of displacements: "body", or "scene" as published
    scaled_rows: bool | None = None  # scale displacements and surroundings; else px, rad and units of 8 px
    heading_on_circle: bool | None = None  # scale predicted orientations to a cosine and a sine
    predicted: str | None = None  # "motion": recompute surroundings from the pose; "row": predict and feed back all
    loss_balance: str | None = None  # "frame": error and divergence per frame; "published": mean error, sum of the KL
    motion_deviation: float = 0.03  # standard deviation of predicted displacements, scaled; for "frame"
    kl_cycles: int | None = None  # cycles of the weight of the divergence in a training
    kl_ramp: float | None = None  # fraction of a cycle in which this weight rises from 0 to 1
    kl_steps: int | None = None  # training steps of all cycles; set from the training

    zero_history: bool | None = None  # the history before an episode is zeros; else the table at rest
    repeat_last_obstacle: bool | None = None  # in execution, absent obstacles are copies of the last one
    velocity_as_goal: bool = (
        False  # in execution, read the velocity as the goal's place: an error of the published code
    )
    controller: str | None = None  # "velocity": feedback with the task's dynamics; "proportional": published
    proportional_gain: float = 0.15  # wrench per px and per rad, in units of a player's full force
    unit_force: bool | None = None  # divide the forces of the proportional controller by their norm
    wrapped_angle: bool | None = None  # the error of the orientation is at most half a turn

    optimizer_lr: float = 8e-4  # peak learning rate of Adam
    optimizer_weight_decay: float | None = None  # L2 weight decay of Adam
    optimizer_grad_clip_norm: float | None = None  # largest gradient norm; 0 does not clip
    scheduler_warmup_steps: int = 0  # updates over which the learning rate rises
    scheduler_final_lr_fraction: float = 0.0  # learning rate of the last update, as a fraction of the peak

    def _validate(self) -> None:
        filled = self.filled
        if get_task(filled.task).motion is None:
            raise InvalidValueError("task", "a task with the part `motion`, which vrnn plans", filled.task)
        if self.past_human_action:
            raise InvalidValueError("past_human_action", "false, as vrnn sees the motion alone", True)
        for name in ("history_frames", "window_frames", "encoded_frames", "plan_frames"):
            if getattr(self, name) % filled.stride:
                raise InvalidValueError(name, f"a multiple of stride = {self.stride}", getattr(self, name))
        if filled.window_frames <= self.history_frames:
            expected = f"more than history_frames = {self.history_frames}"
            raise InvalidValueError("window_frames", expected, self.window_frames)
        if filled.encoded_frames > filled.window_frames:
            raise InvalidValueError(
                "encoded_frames", f"at most window_frames = {self.window_frames}", self.encoded_frames
            )
        if filled.lookahead_frames + self.replan_frames - 1 > filled.plan_frames:
            expected = f"at most plan_frames - replan_frames + 1 = {filled.plan_frames - self.replan_frames + 1}"
            raise InvalidValueError("lookahead_frames", expected, self.lookahead_frames)

    @property
    def observation_delta_indices(self) -> list[int]:
        """Frames of a training window: the history, the current frame and those after it, one a stride."""
        after = self.filled.window_frames - self.history_frames
        return list(range(-self.history_frames, after + 1, self.filled.stride))

    @property
    def action_delta_indices(self) -> list[int]:
        """The current frame; the planner learns motion and reads no action."""
        return [0]

    def get_optimizer_preset(self) -> AdamConfig:
        """Adam with the `optimizer_*` settings."""
        filled = self.filled
        return AdamConfig(
            lr=self.optimizer_lr,
            weight_decay=filled.optimizer_weight_decay,
            grad_clip_norm=filled.optimizer_grad_clip_norm,
        )

    def get_scheduler_preset(self) -> WarmupCosineSchedulerConfig:
        """Cosine decay; the published schedule needs a validation loss, which LeRobot's trainer does not compute."""
        return WarmupCosineSchedulerConfig(self.scheduler_warmup_steps, self.scheduler_final_lr_fraction)
