"""Makes the network of a co-policy from its settings."""

from .configuration_copolicy import CopolicyConfig
from .denoiser_mlp import MlpDenoiser
from .denoiser_transformer import TransformerDenoiser
from .denoiser_unet import UnetDenoiser

Denoiser = TransformerDenoiser | MlpDenoiser | UnetDenoiser

_SIZES = ("horizon", "n_obs_steps", "n_layers", "width")
_DECODER = ("n_heads", "feedforward_width", "attention_dropout", "embedding_dropout")
_UNET = ("n_obs_steps", "down_widths", "kernel_size", "n_groups", "step_width", "inpainting")
_NETWORKS = {
    "transformer": (TransformerDenoiser, (*_SIZES, *_DECODER)),
    "mlp": (MlpDenoiser, _SIZES),
    "unet": (UnetDenoiser, _UNET),
}


def make_denoiser(config: CopolicyConfig, action_size: int, condition_size: int) -> Denoiser:
    """The network `config.network`.

    Args:
        action_size: values of a joint action.
        condition_size: values of an observation after encoding.
    """
    network, names = _NETWORKS[config.filled.network]
    return network(action_size, condition_size, **{name: getattr(config, name) for name in names})


def weight_decay_groups(config: CopolicyConfig, network: Denoiser) -> list[dict]:
    """The network's weights as parameter groups of AdamW, with and without weight decay.

    Biases, norms and position embeddings are not decayed; of the U-Net all weights are, as in Diffusion Policy.
    """
    decayed, plain = [], []
    for name, parameter in network.named_parameters():
        weight = config.network == "unet" or (parameter.ndim > 1 and not name.endswith("_position"))
        (decayed if weight else plain).append(parameter)
    # One fused kernel instead of a dozen small ones per tensor halves the optimizer's time on a CPU.
    fused = decayed[0].device.type in ("cpu", "cuda")
    groups = [{"params": decayed, "fused": fused}, {"params": plain, "weight_decay": 0.0, "fused": fused}]
    return [group for group in groups if group["params"]]
