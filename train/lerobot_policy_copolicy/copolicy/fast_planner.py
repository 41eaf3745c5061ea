"""Planning with the same weights and the same noise as the plain sampler, and without what it computes in vain."""

from collections.abc import Callable
from typing import NamedTuple, Protocol

import torch
from torch import Tensor, nn

from copolicy.dataset.exceptions import InvalidValueError

from .denoiser_mlp import MlpDenoiser
from .denoiser_transformer import TransformerDenoiser
from .fast_mlp import FastMlp
from .fast_transformer import FastTransformer
from .sampler_table import SamplerTable


class _Denoiser(Protocol):
    def denoise(self, noisy_actions: Tensor, inputs: tuple[Tensor, ...]) -> Tensor: ...


class _Prepared(NamedTuple):
    """A network made ready for a number of tokens, and the weights that it was made from."""

    weights: tuple
    network: FastTransformer | FastMlp
    denoiser: _Denoiser


class FastPlanner:
    """Samples plans through tables that are made from a network's weights, and made again when the weights change.

    Changes are seen by PyTorch's version counters: those of optimizers, averages, initialisers and loading all count;
    writing into `parameter.data` does not.

    Args:
        table: the sampler.
        backend: "torch", or on a CPU "onnx" (ONNX Runtime) or "numba".
    """

    def __init__(self, table: SamplerTable, backend: str):
        self._table, self._backend = table, backend
        self._prepared: dict[int, _Prepared] = {}

    def plan(
        self,
        network: nn.Module,
        condition: Tensor,
        noise: Tensor,
        tokens: int,
        generator: torch.Generator | None = None,
    ) -> Tensor:
        """The first tokens of a plan.

        Args:
            network: a `TransformerDenoiser` or `MlpDenoiser`.
            condition: `(B, To, condition_size)`.
            noise: `(B, T, action_size)`, standard normal.
            tokens: how many actions of the plan are wanted, from its first on.
            generator: source of the noise that DDPM adds at each step.

        Returns:
            `(B, tokens, action_size)` in [-1, 1].

        Raises:
            InvalidValueError: a backend other than torch was asked to plan on another device than the CPU.
        """
        if self._backend != "torch" and condition.device.type != "cpu":
            raise InvalidValueError(f"policy.device, for policy.backend={self._backend}", "cpu", condition.device.type)
        ready = self._ready(network, condition.device, tokens)
        at = ready.network.begin(condition)

        def denoise(index: int, actions: Tensor) -> Tensor:
            return ready.denoiser.denoise(actions, at(index))

        return self._table.sample(denoise, noise, ready.network.tokens, generator)[:, :tokens]

    def _ready(self, network: nn.Module, device: torch.device, tokens: int) -> _Prepared:
        weights = tuple((weight.data_ptr(), _version(weight)) for weight in network.parameters())
        ready = self._prepared.get(tokens)
        if ready is None or ready.weights != weights:
            timesteps = torch.tensor([step.timestep for step in self._table.steps], device=device)
            # Tables keep full precision, also where the plan itself is made under automatic mixed precision.
            with torch.autocast(device.type, enabled=False):
                fast = _fast(network)(network, timesteps, tokens)
                denoiser = self._denoiser(fast)
            ready = self._prepared[tokens] = _Prepared(weights, fast, denoiser)
        return ready

    def _denoiser(self, network: FastTransformer | FastMlp) -> _Denoiser:
        if self._backend == "onnx":
            from .onnx_denoiser import OnnxDenoiser

            return OnnxDenoiser(network)
        if self._backend == "numba":
            from .numba_denoiser import NumbaDenoiser

            return NumbaDenoiser(network)
        return network

    def __getstate__(self) -> dict:
        """Without what was prepared: a session of ONNX Runtime can be neither copied nor pickled."""
        return {**self.__dict__, "_prepared": {}}


def _fast(network: nn.Module) -> Callable:
    for denoiser, fast in ((TransformerDenoiser, FastTransformer), (MlpDenoiser, FastMlp)):
        if isinstance(network, denoiser):
            return fast
    raise InvalidValueError("network", "a TransformerDenoiser or MlpDenoiser", type(network).__name__)


def _version(weight: Tensor) -> int:
    return 0 if weight.is_inference() else weight._version
