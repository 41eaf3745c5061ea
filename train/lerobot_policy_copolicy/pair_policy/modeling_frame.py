"""Base of the policies that act frame by frame, with a state that they keep from frame to frame."""

from typing import Any, NoReturn, Unpack

from lerobot.policies.pretrained import ActionSelectKwargs
from torch import Tensor

from copolicy.dataset.exceptions import InvalidValueError

from .modeling_pair import PairPolicy


class FramePolicy(PairPolicy):
    """Predicts one joint action from each frame, by `select_action`; all weights are trained alike.

    Attributes:
        network: has the weights.
    """

    network: Any

    def get_optim_params(self) -> list[dict]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """All weights in one group."""
        parameters = list(self.network.parameters())
        return [{"params": parameters, "fused": parameters[0].device.type in ("cpu", "cuda")}]

    def predict_action_chunk(self, batch: dict[str, Tensor], **kwargs: Unpack[ActionSelectKwargs]) -> Tensor:
        """Not offered: the policy keeps a state from frame to frame.

        Raises:
            NotImplementedError: always; call `select_action`.
        """
        raise NotImplementedError(f"{self.name} acts frame by frame: call select_action")

    def wrap_with_peft(self, peft_config: Any = None, peft_cli_overrides: dict | None = None) -> NoReturn:
        """Not offered: these networks read their own weights, beside which an adapter has no effect.

        Raises:
            InvalidValueError: always.
        """
        expected = f"no adapters: {self.name} reads its weights directly, so an adapter has no effect"
        raise InvalidValueError("--peft", expected, peft_config or peft_cli_overrides)
