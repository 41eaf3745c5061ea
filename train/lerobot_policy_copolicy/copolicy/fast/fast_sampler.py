"""Samples action sequences faster than the plain sampler, from the same weights and noise with the same result."""

from collections.abc import Callable
from contextlib import nullcontext
from typing import Any, NamedTuple, Protocol

import torch
from torch import Tensor, nn

from copolicy.dataset.exceptions import InvalidValueError

from ..denoiser_mlp import MlpDenoiser
from ..denoiser_transformer import TransformerDenoiser
from .backend import AUTO
from .fastest_backend import fastest_backend
from .mlp import FastMlp
from .sampler_coefficients import SamplerCoefficients
from .transformer import FastTransformer


class _Denoiser(Protocol):
    def denoise(self, noisy_actions: Tensor, inputs: tuple[Tensor, ...]) -> Tensor: ...


class _Prepared(NamedTuple):
    """A network prepared for a number of tokens, and the state of the weights it was made from."""

    weights: tuple
    network: FastTransformer | FastMlp
    denoiser: _Denoiser


class FastSampler:
    """Samples with tensors that are precomputed from a network's weights, and recomputed when the weights change.

    Changes are detected by PyTorch's version counters, which optimizers, averages, initialisers and loading advance;
    writing into `parameter.data` does not.

    Args:
        coefficients: the sampler.
        backend: "torch", on a CPU "onnx" (ONNX Runtime) or "numba", or "auto" for the fastest of them.

    Attributes:
        used: names of the backends used so far.
    """

    def __init__(self, coefficients: SamplerCoefficients, backend: str):
        self._coefficients, self._backend = coefficients, backend
        self._prepared: dict[tuple[int, str], _Prepared] = {}
        self._largest_batch = 0
        self.used: set[str] = set()

    def sample(
        self,
        network: nn.Module,
        condition: Tensor,
        noise: Tensor,
        tokens: int,
        generator: torch.Generator | None = None,
    ) -> Tensor:
        """Samples the first `tokens` actions of each sequence.

        Args:
            network: a `TransformerDenoiser` or `MlpDenoiser`.
            condition: `(B, To, condition_size)`.
            noise: `(B, T, action_size)`, standard normal.
            tokens: number of actions, from the first one of the sequence on.
            generator: source of the noise that DDPM adds at each step.

        Returns:
            `(B, tokens, action_size)` in [-1, 1].

        Raises:
            InvalidValueError: a backend other than torch on another device than the CPU.
        """
        if self._backend not in (AUTO, "torch") and condition.device.type != "cpu":
            raise InvalidValueError(f"policy.device, for policy.backend={self._backend}", "cpu", condition.device.type)
        backend = self._backend_for(condition)
        self.used.add(backend)
        prepared = self._prepare(network, condition.device, tokens, backend)

        def denoise(index: int, actions: Tensor) -> Tensor:
            return prepared.denoiser.denoise(actions, inputs_at(index))

        # Automatic mixed precision applies to torch only; other backends take float32.
        with nullcontext() if backend == "torch" else torch.autocast("cpu", enabled=False):
            inputs_at = prepared.network.begin(condition if backend == "torch" else condition.float())
            return self._coefficients.sample(denoise, noise, prepared.network.tokens, generator)[:, :tokens]

    def _backend_for(self, condition: Tensor) -> str:
        if self._backend != AUTO:
            return self._backend
        # In a study the batch shrinks as episodes end; preparing another backend for its last episodes is slower.
        self._largest_batch = max(self._largest_batch, len(condition))
        return fastest_backend(condition, self._largest_batch)

    def _prepare(self, network: nn.Module, device: torch.device, tokens: int, backend: str) -> _Prepared:
        weights = tuple((weight.data_ptr(), _version(weight)) for weight in network.parameters())
        prepared = self._prepared.get((tokens, backend))
        if prepared is None or prepared.weights != weights:
            timesteps = torch.tensor([step.timestep for step in self._coefficients.steps], device=device)
            # Precomputed tensors have full precision, also under automatic mixed precision.
            with torch.autocast(device.type, enabled=False):
                fast = _fast(network)(network, timesteps, tokens)
                denoiser = _denoiser(fast, backend)
            prepared = self._prepared[tokens, backend] = _Prepared(weights, fast, denoiser)
        return prepared

    def __getstate__(self) -> dict[str, Any]:
        """State without prepared networks: a session of ONNX Runtime can be neither copied nor pickled."""
        return {**self.__dict__, "_prepared": {}}


def _denoiser(network: FastTransformer | FastMlp, backend: str) -> _Denoiser:
    if backend == "onnx":
        from .onnx_denoiser import OnnxDenoiser

        return OnnxDenoiser(network)
    if backend == "numba":
        from .numba_denoiser import NumbaDenoiser

        return NumbaDenoiser(network)
    return network


def _fast(network: nn.Module) -> Callable:
    for denoiser, fast in ((TransformerDenoiser, FastTransformer), (MlpDenoiser, FastMlp)):
        if isinstance(network, denoiser):
            return fast
    raise InvalidValueError("network", "a TransformerDenoiser or MlpDenoiser", type(network).__name__)


def _version(weight: Tensor) -> int:
    return 0 if weight.is_inference() else weight._version
