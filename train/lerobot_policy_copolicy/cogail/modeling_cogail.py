"""Co-GAIL: generative adversarial imitation of both players with a latent code, and its inverse model."""

from typing import NoReturn, Unpack

import torch
from lerobot.policies.pretrained import ActionSelectKwargs
from torch import Tensor

from copolicy.dataset.exceptions import RunError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.dataset.task import get_task

from ..pair_policy.modeling_frame import FramePolicy
from .codes import EXECUTED_POINT, GRID, draw_codes
from .configuration_cogail import CoGailConfig
from .inputs import HistoryInputs, first_history, next_history
from .network import CoGailNetwork


class CoGailPolicy(FramePolicy):
    """Predicts the next joint action from a history of states and a code, as a deterministic mean.

    The code stands for the partner's strategy. In execution it is drawn or inferred, see `CoGailConfig`. A code is
    inferred from the partner's action of the last frame and the observation of that frame; the first frame has none,
    and draws.

    Wang et al., "Co-GAIL: Learning Diverse Strategies for Human-Robot Collaboration" (CoRL 2021, arXiv 2108.06038).

    Attributes:
        inputs: encodes history and scenario.
        network: actor, critic and inverse model.
    """

    config_class = CoGailConfig  # pyright: ignore[reportAssignmentType]
    name = "cogail"  # pyright: ignore[reportAssignmentType]
    config: CoGailConfig

    def __init__(self, config: CoGailConfig, **kwargs):
        super().__init__(config, **kwargs)
        filled = config.filled
        encoder = None if filled.observation_features == "absolute" else self.features
        self.inputs = HistoryInputs(get_task(filled.task).spec, config.history, encoder, filled.input_range)
        self.network = CoGailNetwork(self.inputs.size, self._sizes[ACTION], config.width, filled.initial_deviation)
        self.reset()

    def reset(self) -> None:
        """Clears history and code; call it whenever the environment is reset."""
        self._history: Tensor | None = None  # (B, T, n)
        self._inputs: Tensor | None = None  # (B, size), of the last frame
        self._code: Tensor | None = None  # (B, 2)

    @torch.no_grad()
    def select_action(self, batch: dict[str, Tensor], **kwargs: Unpack[ActionSelectKwargs]) -> Tensor:
        """The joint action of the current frame; call it once per frame.

        Args:
            batch: observation columns `(B, n)` of single frames.

        Returns:
            `(B, m)` within the bounds of the task.
        """
        observation = self._observation(batch, None)
        states = observation[STATE]
        if self._history is None:
            self._history = first_history(states, self.config.history, self.config.filled.history_start)
        else:
            self._history = next_history(self._history, states)
        inputs = self.inputs(self._history, observation[ENVIRONMENT_STATE])
        self._code = self._next_code(observation, len(states)).to(inputs)
        self._inputs = inputs
        return self.action_scale.physical(self.network.mean(inputs, self._code).clamp(-1.0, 1.0))

    def _next_code(self, observation: dict[str, Tensor], size: int) -> Tensor:
        if self.config.code == "inferred" and self._inputs is not None:
            return self.network.infer_code(self._inputs, self._scaled_partner(observation[HUMAN_ACTION]))
        if self.config.code == "episode":
            # As in training, one code an episode, from anywhere on the grid.
            return draw_codes(torch.randint(len(GRID), (size,))) if self._code is None else self._code
        return draw_codes(torch.full((size,), EXECUTED_POINT))

    def _scaled_partner(self, actions: Tensor) -> Tensor:
        """The partner's actions `(B, m)` scaled to [-1, 1]."""
        return self.action_scale.scaled(torch.cat((actions, actions), dim=-1))[..., actions.shape[-1] :]

    def forward(self, batch: dict[str, Tensor], reduction: str = "mean") -> NoReturn:
        """Not offered: the policy is trained in the world.

        Raises:
            RunError: always; names the command.
        """
        raise RunError("cogail learns in the world of the task, not from batches: use copolicy-train cogail")
