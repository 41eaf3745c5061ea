"""Chooses the fastest installed backend for a batch size."""

import logging
import math
from functools import cache
from importlib import import_module

import torch
from torch import Tensor

from .backend import BACKENDS

# By largest batch size, the fastest first. The compiled kernels are optimised for the few rows of one sequence; with
# more rows general matrix products are faster. `tests/benchmarks/planning.py --batches` measures the limits.
_ORDER = {8: ("numba", "onnx", "torch"), 16: ("onnx", "numba", "torch"), math.inf: ("onnx", "torch")}


def fastest_backend(condition: Tensor, batch_size: int) -> str:
    """The fastest installed backend for a batch; logs the choice once in a process.

    Args:
        condition: the network's input features. For tensors other than float32 on a CPU, and under automatic mixed
            precision, the backend is torch.
        batch_size: number of sequences sampled at once.
    """
    device = condition.device.type
    if device != "cpu" or condition.dtype != torch.float32 or torch.is_autocast_enabled(device):
        return "torch"
    chosen = {limit: next(name for name in names if _is_available(name)) for limit, names in _ORDER.items()}
    _log_choice(tuple(chosen.items()))
    return next(name for limit, name in chosen.items() if batch_size <= limit)


@cache
def _is_available(backend: str) -> bool:
    """Whether the packages of a backend can be imported; logs the reason if an installed one cannot."""
    for package in BACKENDS[backend]:
        try:
            import_module(package)
        except ModuleNotFoundError as error:
            if error.name != package:
                logging.warning("sampling without %s: %s", backend, error)
            return False
        except Exception as error:  # an incompatible package may raise anything
            logging.warning("sampling without %s: %s: %s", backend, type(error).__name__, error)
            return False
    return True


@cache
def _log_choice(chosen: tuple[tuple[float, str], ...]) -> None:
    limits = {name: limit for limit, name in chosen}  # the largest limit of each backend
    parts = [f"{name} (batches of up to {limit:g})" for name, limit in limits.items() if limit < math.inf]
    name = chosen[-1][1]
    text = ", ".join([*parts, f"{name} (larger batches)"] if parts else [name])
    logging.info("sampling on the CPU with %s: the fastest installed backends (backend=auto)", text)
