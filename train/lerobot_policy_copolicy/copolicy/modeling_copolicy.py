"""The diffusion co-policy: one network predicts the actions of both players, the robot executes its half.

Ng, Liu and Kennedy, "Diffusion Co-Policy for Synergistic Human-Robot Collaborative Tasks" (2023, arXiv 2305.12171).
"""

from collections import deque
from typing import Unpack

import torch
from lerobot.policies.pretrained import ActionSelectKwargs
from torch import Tensor

from copolicy.dataset.exceptions import InvalidValueError, ShapeError
from copolicy.dataset.features import ACTION

from ..pair_policy.modeling_pair import PairPolicy
from .configuration_copolicy import CopolicyConfig
from .diffusion import ActionDiffusion
from .ema import ExponentialMovingAverage
from .fast.backend import require_backend
from .fast.fast_sampler import FastSampler
from .networks import make_denoiser, weight_decay_groups

_PADDING = f"{ACTION}_is_pad"


class CopolicyPolicy(PairPolicy):
    """Predicts the next actions of both players from the last frames and the human's past actions.

    `select_action` explains which frames are observed and which actions are executed. In training, actions beyond
    either end of the episode repeat its first or last action; the "paper" preset starts no sample in the last 9 frames,
    so that only the beginning is padded.

    Inputs and outputs are in the units of the task, [-1, 1] for actions of the table; they are scaled by the bounds of
    the task inside the policy. To is `n_obs_steps`, T is `horizon`, m the number of values of a joint action. With
    `inpainting`, the sequence that is denoised also has the observations of all T frames.
    """

    config_class = CopolicyConfig  # pyright: ignore[reportAssignmentType]
    name = "copolicy"  # pyright: ignore[reportAssignmentType]
    config: CopolicyConfig

    def __init__(self, config: CopolicyConfig, **kwargs):
        super().__init__(config, **kwargs)
        self.denoiser = make_denoiser(config, self._sizes[ACTION], self.features.size)
        self.diffusion = ActionDiffusion(config)
        require_backend(config.backend)
        is_fast = config.planner == "fast" and config.network != "unet"
        self._fast = FastSampler(self.diffusion.coefficients, config.backend) if is_fast else None
        self.ema = (
            ExponentialMovingAverage(self.denoiser, config.ema_power, config.ema_inv_gamma, config.ema_max_decay)
            if config.ema
            else None
        )
        if config.compile_model:
            # In place, so that weights keep their names, and after the copy of the average. All layers share one
            # compiled graph: seconds instead of minutes. Static shapes: the smaller last batch of an epoch is compiled
            # separately instead of making all others slower.
            for layer in self.denoiser.layers:
                layer.compile(dynamic=False)
        self.reset()

    def get_optim_params(self) -> list[dict]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The network's weights in groups with and without weight decay; the moving average is in neither."""
        return weight_decay_groups(self.config, self.denoiser)

    def update(self) -> None:
        """Updates the moving average; LeRobot's trainer calls this after each optimizer step.

        Raises:
            NonFiniteLossError: the loss of that step is NaN or infinite.
        """
        if self.ema is not None:
            self.ema.update(self.denoiser)
        super().update()

    def reset(self) -> None:
        """Clears the history and the queued actions; call it whenever the environment is reset."""
        self._history: dict[str, deque[Tensor]] = {
            key: deque(maxlen=self.config.n_obs_steps) for key in self.config.observation_keys
        }
        self._queue: deque[Tensor] = deque()

    def forward(self, batch: dict[str, Tensor], reduction: str = "mean") -> tuple[Tensor, dict]:
        """The training loss: mean squared error of the prediction over all tokens and both players.

        With inpainting it is the mean over actions and observations, where an error of an observation of the history
        counts as zero, as in Diffusion Policy.

        Args:
            batch: observation columns `(B, To, n)`, for inpainting `(B, T, n)`; `action` `(B, T, m)` of both players;
                and its padding mask `(B, T)` if `do_mask_loss_for_padding` is set.
            reduction: "mean", or "none" for one loss per sample (LeRobot's sample weighting).

        Returns:
            The loss, and an empty dict: reading a number here would synchronise with the GPU before the backward pass.

        Raises:
            InvalidValueError: a column is missing.
            ShapeError: a column has another shape.
            RunError: the batch has a frame of an excluded episode, or the loss of the previous step is not finite.
        """
        observed, frames = self.config.n_obs_steps, len(self.config.observation_delta_indices)
        sample = self._training_sample(batch, frames, self.config.horizon)
        sequence, features = self.action_scale.scaled(sample[ACTION]), self.features(sample)
        if self.config.inpainting:
            sequence = torch.cat((sequence, features), dim=-1)  # (B, T, m + features.size)
        noisy, steps, target = self.diffusion.add_noise(sequence)
        prediction = self.denoiser(noisy, steps, features[:, :observed])
        error = (prediction.float() - target).square()
        if self.config.inpainting:
            error[:, :observed, self._sizes[ACTION] :] = 0
        loss = self._reduced(error.mean(dim=-1), batch, reduction)
        if self.training:
            self._loss = loss.detach()
        return loss, {}

    def _reduced(self, error: Tensor, batch: dict[str, Tensor], reduction: str) -> Tensor:
        """The loss of errors `(B, T)`: a scalar, or one per sample `(B,)` for the reduction "none"."""
        if self.config.do_mask_loss_for_padding:
            if _PADDING not in batch:
                raise InvalidValueError("batch, for do_mask_loss_for_padding", _PADDING, sorted(batch))
            mask = (~batch[_PADDING]).to(error.dtype)
            if reduction == "mean":
                return (error * mask).sum() / mask.sum()
            return (error * mask).sum(dim=1) / mask.sum(dim=1).clamp(min=1)
        return error.mean() if reduction == "mean" else error.mean(dim=1)

    def _finished_updates(self) -> int:
        return int(self.ema.updates) if self.ema is not None else super()._finished_updates()

    @torch.no_grad()
    def sample_actions(
        self,
        batch: dict[str, Tensor],
        generator: torch.Generator | None = None,
        noise: Tensor | None = None,
        actions: int | None = None,
    ) -> Tensor:
        """Samples an action sequence for each history; keeps no state.

        Args:
            batch: observation columns `(B, To, n)`, oldest frame first, in physical units.
            generator: source of the noise; the global one if None.
            noise: `(B, T, m)` standard normal initial noise, for inpainting `(B, T, m + features.size)`; drawn if None.
            actions: number of actions from the current frame on; all if None. Fewer are faster and have equal values.

        Returns:
            `(B, To - 1 + actions, m)` within the bounds of the task, `(B, T, m)` for all actions; index `To - 1` is the
            action of the current frame.

        Raises:
            InvalidValueError: a column is missing, or `actions` is not from 1 to T - To + 1.
            ShapeError: a column has another shape.
        """
        condition = self.features(self._observation(batch, self.config.n_obs_steps))
        size = self._sizes[ACTION]
        shape = (len(condition), self.config.horizon, size + self.features.size * bool(self.config.inpainting))
        if noise is None:
            # On the CPU, so that a seed gives the same noise on every device.
            noise = torch.randn(shape, generator=generator, device="cpu" if generator is None else generator.device)
        elif noise.shape != shape:
            raise ShapeError("noise", shape, tuple(noise.shape))
        noise, tokens = noise.to(condition.device), self._tokens(actions)
        network = self.denoiser if self.ema is None else self.ema.model
        if self._fast is not None:
            sequence = self._fast.sample(network, condition, noise, tokens, generator)
        else:
            sequence = self.diffusion.sample(lambda noisy, steps: network(noisy, steps, condition), noise, generator)
        return self.action_scale.physical(sequence[:, :tokens, :size])

    @property
    def planned_with(self) -> tuple[str, ...]:
        """Backends that have run the network in inference so far; the plain sampler runs it with torch."""
        return ("torch",) if self._fast is None else tuple(sorted(self._fast.used))

    @torch.no_grad()
    def predict_action_chunk(self, batch: dict[str, Tensor], **kwargs: Unpack[ActionSelectKwargs]) -> Tensor:
        """Predicts the next `n_action_steps` joint actions, from the current frame on.

        Args:
            batch: whole histories `(B, To, n)`; or single frames `(B, n)`, which are appended to the history since
                `reset`.
            kwargs: initial `noise`, see `sample_actions`.

        Returns:
            `(B, n_action_steps, m)` within the bounds of the task.
        """
        if all(key in batch and self._is_frame(key, batch[key]) for key in self.config.observation_keys):
            batch = self._observe(batch)
        sequence = self.sample_actions(batch, **kwargs, actions=self.config.n_action_steps)
        return sequence[:, self.config.n_obs_steps - 1 :]

    @torch.no_grad()
    def select_action(self, batch: dict[str, Tensor], **kwargs: Unpack[ActionSelectKwargs]) -> Tensor:
        """The joint action of the current frame n; predicts a new chunk when the queue of actions is empty.

        A chunk predicted at frame n (legend: o = n_obs_steps, a = n_action_steps, T = horizon; o + a <= T + 1):

            |frame                         | n-o+1 | ... | n-1 |  n  | n+1 | ... | n+a-1 | n+a | ... | n-o+T |
            |observation is used           |  YES  | YES | YES | YES | NO  | NO  |  NO   | NO  | NO  |  NO   |
            |human's past action is used   |  YES  | YES | YES | YES | NO  | NO  |  NO   | NO  | NO  |  NO   |
            |robot's action is in sequence |  YES  | YES | YES | YES | YES | YES |  YES  | YES | YES |  YES  |
            |human's action is in sequence |  YES  | YES | YES | YES | YES | YES |  YES  | YES | YES |  YES  |
            |robot's action is executed    |  NO   | NO  | NO  | YES | YES | YES |  YES  | NO  | NO  |  NO   |
            |human's action is executed    |  NO   | NO  | NO  | (*) | (*) | (*) |  (*)  | NO  | NO  |  NO   |

        (*) in co-planning; with a person at the human's seat it is a prediction only. The human's past action of a
        frame is the one executed in the frame before it, and is not used if `past_human_action` is false. At the start
        of an episode the history consists of copies of the first frame. The fast sampler omits actions after n+a-1.

        Args:
            batch: single frames `(B, n)`; call once per frame, so that the history is complete.
            kwargs: initial `noise`, see `sample_actions`.

        Returns:
            `(B, m)` within the bounds of the task, the robot's action first.
        """
        history = self._observe(batch)
        if not self._queue:
            self._queue.extend(self.predict_action_chunk(history, **kwargs).unbind(dim=1))
        return self._queue.popleft()

    def _observe(self, batch: dict[str, Tensor]) -> dict[str, Tensor]:
        """Appends a frame to the history, which starts with copies of its first frame; returns it `(B, To, n)`."""
        for key, frames in self._history.items():
            frames.append(self._column(batch, key))
            while len(frames) < self.config.n_obs_steps:
                frames.append(frames[-1])
        return {key: torch.stack(tuple(frames), dim=1) for key, frames in self._history.items()}

    def _is_frame(self, key: str, values: Tensor) -> bool:
        """Whether a column has single frames; a column with one value per frame may lack its last axis."""
        return values.ndim == 2 if self._sizes[key] > 1 else values.ndim == 1 or values.shape[1:] == (1,)

    def _tokens(self, actions: int | None) -> int:
        """Length of a sequence with the given number of actions from the current frame on."""
        limit = self.config.horizon - self.config.n_obs_steps + 1
        if actions is not None and not 1 <= actions <= limit:
            raise InvalidValueError("actions", f"1 to {limit}", actions)
        return self.config.n_obs_steps - 1 + (actions or limit)
