"""The VRNN planner: a generative model of body motion, sampled futures, and a controller that follows the best one."""

from collections import deque
from typing import Any, Unpack

import torch
from lerobot.policies.pretrained import ActionSelectKwargs
from torch import Tensor

from copolicy.dataset.features import ENVIRONMENT_STATE, STATE
from copolicy.dataset.task import BodyMotion, PairTask, get_task

from ..pair_policy.callers import training_steps_of_callers
from ..pair_policy.modeling_frame import FramePolicy
from .configuration_vrnn import VrnnConfig
from .loss import balanced_loss, kl_weight, published_loss
from .motion_rows import MOTION, MotionRows, PointFeatures
from .network import MotionNetwork
from .planner import MotionPlanner
from .prediction import encode, free_run

_PADDING = f"{STATE}_is_pad"


class VrnnPolicy(FramePolicy):
    """Plans the motion of the body, and acts for both players to follow the plan.

    A variational recurrent network learns the body's motion from `window_frames`: latent variables of the first
    `encoded_frames` are drawn from the encoder, the others from the prior, with the predictions as inputs. Frames
    before the episode repeat its first one, the body at rest; frames beyond its end do not count.

    In execution `n_samples` futures are drawn every `replan_frames`. A controller drives to the waypoint
    `lookahead_frames` ahead in the future with the greatest sum of rewards.

    Ng et al., "It Takes Two: Learning to Plan for Human-Robot Cooperative Carrying" (ICRA 2023, arXiv 2209.12890).
    """

    config_class = VrnnConfig  # pyright: ignore[reportAssignmentType]
    name = "vrnn"  # pyright: ignore[reportAssignmentType]
    config: VrnnConfig
    updates: Tensor

    def __init__(self, config: VrnnConfig, **kwargs):
        super().__init__(config, **kwargs)
        settings: Any = config.filled
        config.kl_steps = training_steps_of_callers() or config.kl_steps
        task = get_task(settings.task)
        rows = MotionRows(
            _motion_of(task),
            self.features,
            settings.stride / (config.fps or task.spec.record_hz),
            settings.motion_axes == "body",
            settings.scaled_rows,
            settings.heading_on_circle,
        )
        size = MOTION + self.features.size
        predicted = MOTION if config.predicted == "motion" else size
        self.network = MotionNetwork(size, predicted, config.latent, config.width, config.n_layers)
        self._rows = rows
        bounds = torch.tensor(task.spec.joint_action.bounds, dtype=torch.float32)
        self._planner = MotionPlanner(self.network, rows, config, bounds)
        self.register_buffer("updates", torch.zeros((), dtype=torch.int64))  # finished, also before a resumed training
        self.reset()

    def _make_features(self, task: PairTask) -> Any:
        if self.config.observation_features != "points":
            return super()._make_features(task)
        settings: Any = self.config.filled
        bounds = torch.tensor(task.spec.state.bounds, dtype=torch.float32) if settings.observe_pose else None
        features = PointFeatures(_motion_of(task), settings.scaled_rows, bounds)
        features.repeat_last, features.velocity_as_goal = settings.repeat_last_obstacle, settings.velocity_as_goal
        return features

    def update(self) -> None:
        """Counts the steps of the divergence's weight; LeRobot's trainer calls this after each optimizer step.

        Raises:
            NonFiniteLossError: the loss of that step is NaN or infinite.
        """
        self.updates += 1
        super().update()

    def _finished_updates(self) -> int:
        return int(self.updates)

    def reset(self) -> None:
        """Clears the history and the plan; call it whenever the environment is reset."""
        self._states: deque[Tensor] = deque(maxlen=self.config.history_frames + 1)
        self._path: Tensor | None = None  # (B, T, 4) poses
        self._age = 0  # frames since the plan

    def forward(self, batch: dict[str, Tensor], reduction: str = "mean") -> tuple[Tensor, dict]:
        """The training loss, see `loss.py`.

        Args:
            batch: observation columns `(B, window_frames / stride + 1, n)`, action `(B, 1, m)`, which is not read, and
                if there is padding its mask `(B, window_frames / stride + 1)`.
            reduction: "mean", or "none" for one loss per sample.

        Returns:
            The loss, and an empty dict.

        Raises:
            InvalidValueError: a column is missing.
            ShapeError: a column has another shape.
            RunError: the batch has a frame of an excluded episode, or the loss of the step before is not finite.
        """
        settings: Any = self.config.filled
        steps = settings.window_frames // settings.stride
        encoded = settings.encoded_frames // settings.stride
        sample = self._training_sample(batch, steps + 1, 1)
        poses, scenarios = self._rows.motion.poses(sample[STATE]), sample[ENVIRONMENT_STATE][:, 0]
        rows = self._rows.rows(poses, scenarios)  # (B, T, n)
        latents, tops, posterior, state = encode(self.network, rows[:, :encoded])
        predicted, prior = self.network.decode(latents, tops), self.network.prior(tops)
        if encoded < steps:
            continued = free_run(self.network, self._rows, state, poses[:, encoded], scenarios, steps - encoded)
            predicted = torch.cat((predicted, continued.predicted), dim=1)
        counts = torch.ones(rows.shape[:2], dtype=torch.bool, device=rows.device)
        if _PADDING in batch:
            history = self.config.history_frames // settings.stride
            counts[:, history:] = ~batch[_PADDING][:, history + 1 :]
        error = torch.where(counts[..., None], predicted - rows[..., : predicted.shape[-1]], 0)
        weight = kl_weight(int(self.updates), self.config.kl_steps, settings.kl_cycles, settings.kl_ramp)
        if settings.loss_balance == "published":
            loss = published_loss(error, posterior, prior, weight)
        else:
            loss = balanced_loss(error, counts, posterior, prior, weight, self.config.motion_deviation)
        loss = loss.mean() if reduction == "mean" else loss
        if self.training:
            self._loss = loss.detach()
        return loss, {}

    @torch.no_grad()
    def select_action(self, batch: dict[str, Tensor], **kwargs: Unpack[ActionSelectKwargs]) -> Tensor:
        """The joint action of the current frame; call it once per frame.

        Args:
            batch: observation columns `(B, n)` of single frames.

        Returns:
            `(B, m)` within the bounds of the task.
        """
        observation = self._observation(batch, None)
        state = observation[STATE]
        if not self._states:
            before = torch.zeros_like(state) if self.config.filled.zero_history else state
            self._states.extend([before] * self.config.history_frames)
        self._states.append(state)
        if self._path is None or self._age >= self.config.replan_frames:
            states = torch.stack(list(self._states)[:: self.config.filled.stride], dim=1)
            self._path, self._age = self._planner.plan(states, observation[ENVIRONMENT_STATE]), 0
        actions = self._planner.follow(self._path, self._age, state)
        self._age += 1
        return actions


def _motion_of(task: PairTask) -> BodyMotion:
    assert task.motion is not None, "checked by the configuration"
    return task.motion
