"""The CNN of Diffusion Policy: a temporal U-Net that denoises the sequence as a whole. The network is LeRobot's."""

from contextlib import nullcontext

import torch
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.policies.diffusion.configuration_diffusion import DiffusionConfig
from lerobot.policies.diffusion.modeling_diffusion import DiffusionConditionalUnet1d
from torch import Tensor, nn

from copolicy.dataset.features import ACTION


class UnetDenoiser(nn.Module):
    """LeRobot's `DiffusionConditionalUnet1d` with FiLM scale and bias, as a network of the co-policy.

    It is the `ConditionalUnet1D` of Chi et al. (2023): 65,987,588 parameters for the defaults, actions of 4 values and
    3 frames of 18 values. T is a multiple of `2 ** (len(down_widths) - 1)`.

    By default the history is a condition of all layers ("global" conditioning): FiLM gets it beside the diffusion step.
    With `inpainting`, the sequence has actions and observations, and the observations of the history are set to their
    values before each denoising step; the network has no other condition (65,245,718 parameters).

    Args:
        action_size: values of an action, m.
        condition_size: values of an observation, c.
        n_obs_steps: frames of the history, To.
        down_widths: channels of the levels; each level has half as many frames as the one before.
        kernel_size: of the convolutions, odd.
        n_groups: of the group normalisation.
        step_width: size of the embedding of the diffusion step.
        inpainting: denoise actions and observations.
    """

    def __init__(
        self,
        action_size: int,
        condition_size: int,
        n_obs_steps: int,
        down_widths: tuple[int, ...] = (256, 512, 1024),
        kernel_size: int = 5,
        n_groups: int = 8,
        step_width: int = 256,
        inpainting: bool = False,
    ):
        super().__init__()
        self.inpainting, self._action_size, self._n_obs_steps = inpainting, action_size, n_obs_steps
        channels = action_size + condition_size if inpainting else action_size
        settings = DiffusionConfig(
            device="cpu",
            output_features={ACTION: PolicyFeature(FeatureType.ACTION, (channels,))},
            down_dims=tuple(down_widths),
            kernel_size=kernel_size,
            n_groups=n_groups,
            diffusion_step_embed_dim=step_width,
            use_film_scale_modulation=True,
            horizon=2 ** len(down_widths),  # not used by the network; it is checked more strictly than needed
        )
        self.unet = DiffusionConditionalUnet1d(settings, 0 if inpainting else n_obs_steps * condition_size)

    @property
    def layers(self) -> tuple[nn.Module, ...]:
        """The U-Net as one layer: its blocks differ in shape, so that they cannot share compiled code."""
        return (self.unet,)

    def forward(self, noisy: Tensor, steps: Tensor, condition: Tensor) -> Tensor:
        """Predicts the noise, the sequence or the velocity, depending on the training target.

        Args:
            noisy: `(B, T, m)` actions, or `(B, T, m + c)` actions and observations for inpainting.
            steps: `(B,)` diffusion steps.
            condition: `(B, To, c)`.

        Returns:
            The prediction, with the shape of `noisy`.
        """
        # On a CPU without automatic mixed precision: the backward pass of convolutions in bf16 is far slower there.
        with torch.autocast("cpu", enabled=False) if noisy.device.type == "cpu" else nullcontext():
            if self.inpainting:
                return self.unet(self.with_observed(noisy, condition), steps)
            return self.unet(noisy, steps, condition.flatten(1))

    def with_observed(self, sequence: Tensor, condition: Tensor) -> Tensor:
        """A sequence `(B, T, m + c)` with the observations of the history replaced by `condition` `(B, To, c)`."""
        history = torch.cat((sequence[:, : self._n_obs_steps, : self._action_size], condition), dim=-1)
        return torch.cat((history, sequence[:, self._n_obs_steps :]), dim=1)
