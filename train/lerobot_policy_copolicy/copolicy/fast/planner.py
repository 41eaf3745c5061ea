"""Planning with the same weights and the same noise as the plain sampler, and without what it computes in vain."""

from collections.abc import Callable
from contextlib import nullcontext
from typing import NamedTuple, Protocol

import torch
from torch import Tensor, nn

from copolicy.dataset.exceptions import InvalidValueError

from ..denoiser_mlp import MlpDenoiser
from ..denoiser_transformer import TransformerDenoiser
from .backend import AUTO
from .fastest_backend import fastest_backend
from .mlp import FastMlp
from .sampler_table import SamplerTable
from .transformer import FastTransformer


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
        backend: "torch", on a CPU "onnx" (ONNX Runtime) or "numba", or "auto" for the fastest of them.

    Attributes:
        used: backends that have planned.
    """

    def __init__(self, table: SamplerTable, backend: str):
        self._table, self._backend = table, backend
        self._prepared: dict[tuple[int, str], _Prepared] = {}
        self._most = 0  # plans made at once
        self.used: set[str] = set()

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
        if self._backend not in (AUTO, "torch") and condition.device.type != "cpu":
            raise InvalidValueError(f"policy.device, for policy.backend={self._backend}", "cpu", condition.device.type)
        backend = self._chosen(condition)
        self.used.add(backend)
        ready = self._ready(network, condition.device, tokens, backend)

        def denoise(index: int, actions: Tensor) -> Tensor:
            return ready.denoiser.denoise(actions, at(index))

        # Automatic mixed precision is torch's; the others take float32.
        with nullcontext() if backend == "torch" else torch.autocast("cpu", enabled=False):
            at = ready.network.begin(condition if backend == "torch" else condition.float())
            return self._table.sample(denoise, noise, ready.network.tokens, generator)[:, :tokens]

    def _chosen(self, condition: Tensor) -> str:
        if self._backend != AUTO:
            return self._backend
        # The tables of a study end one after the other: the last one is not worth making another backend ready.
        self._most = max(self._most, len(condition))
        return fastest_backend(condition, self._most)

    def _ready(self, network: nn.Module, device: torch.device, tokens: int, backend: str) -> _Prepared:
        weights = tuple((weight.data_ptr(), _version(weight)) for weight in network.parameters())
        ready = self._prepared.get((tokens, backend))
        if ready is None or ready.weights != weights:
            timesteps = torch.tensor([step.timestep for step in self._table.steps], device=device)
            # Tables keep full precision, also where the plan itself is made under automatic mixed precision.
            with torch.autocast(device.type, enabled=False):
                fast = _fast(network)(network, timesteps, tokens)
                denoiser = _denoiser(fast, backend)
            ready = self._prepared[tokens, backend] = _Prepared(weights, fast, denoiser)
        return ready

    def __getstate__(self) -> dict:
        """Without what was prepared: a session of ONNX Runtime can be neither copied nor pickled."""
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
