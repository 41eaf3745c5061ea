"""Which backend is the fastest of those installed, for the plans at hand."""

import logging
import math
from functools import cache
from importlib import import_module

import torch
from torch import Tensor

from .backend import BACKENDS

# For so many plans at once, the fastest first. Compiled kernels are made for the few rows of one plan; with more rows
# the general matrix products of the others catch up. `tests/benchmarks/planning.py --batches` measures where.
_ORDER = {4: ("numba", "onnx", "torch"), 16: ("onnx", "numba", "torch"), math.inf: ("onnx", "torch")}


def fastest_backend(condition: Tensor, plans: int) -> str:
    """The fastest installed backend for plans from a history; the plans are those of any other, up to rounding.

    Says so in the log, once in a process.

    Args:
        condition: what the network sees of the history: anything but float32 on a CPU is for torch, and so is
            automatic mixed precision.
        plans: how many are made at once.
    """
    device = condition.device.type
    if device != "cpu" or condition.dtype != torch.float32 or torch.is_autocast_enabled(device):
        return "torch"
    chosen = {most: next(name for name in names if _loads(name)) for most, names in _ORDER.items()}
    _say(tuple(chosen.items()))
    return next(name for most, name in chosen.items() if plans <= most)


@cache
def _loads(backend: str) -> bool:
    """Whether the packages of a backend are installed and fit the others that are."""
    for package in BACKENDS[backend]:
        try:
            import_module(package)
        except ModuleNotFoundError as error:
            if error.name != package:
                logging.warning("planning without %s: %s", backend, error)
            return False
        except Exception as error:  # what a package raises that does not fit another one is its own choice
            logging.warning("planning without %s: %s: %s", backend, type(error).__name__, error)
            return False
    return True


@cache
def _say(chosen: tuple[tuple[float, str], ...]) -> None:
    largest = {name: most for most, name in chosen}  # the last of each
    how = ", ".join(f"{name} (up to {most:g} plans at once)" for name, most in largest.items() if most < math.inf)
    rest = chosen[-1][1]
    how = f"{how}, {rest} (more)" if how else rest
    logging.info("planning on the CPU with %s: the fastest that is installed (--policy.backend sets one)", how)
