"""Flags that several studies of `copolicy-eval` share, and what they mean."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from copolicy.dataset.clock import stride
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import Physics

if TYPE_CHECKING:
    from .planner import Planner

ANGULAR_LIMITS = {"pi/2": math.pi / 2, "pi/8": math.pi / 8}
_POLICY_SETTINGS = ("sampler", "num_inference_steps", "initial_noise_scale", "backend")


def add_study_flags(command: argparse.ArgumentParser, actions_per_plan: int) -> None:
    """Everything that a simulated study has beside its maps and its output."""
    command.add_argument("--fps", type=int, default=10, help="rate of the training data (default: 10, a hold of three)")
    command.add_argument("--device", default="cpu", help="default: cpu")
    add_protocol_flags(command, actions_per_plan)


def add_protocol_flags(command: argparse.ArgumentParser, actions_per_plan: int) -> None:
    """How a robot plans, the world's settings, seed and `--overwrite`."""
    command.add_argument(
        "--actions-per-plan",
        type=int,
        default=actions_per_plan,
        help=f"executed before replanning (default: {actions_per_plan})",
    )
    command.add_argument("--step-limit", type=int, default=2000, help="30 Hz steps until a time-out (default: 2000)")
    command.add_argument("--angular-limit", choices=ANGULAR_LIMITS, default="pi/2", help="default: pi/2")
    command.add_argument(
        "--sampler", choices=("ddpm", "ddim", "dpmsolver++"), help="denoising (default: the checkpoint's)"
    )
    command.add_argument(
        "--backend", choices=("torch", "onnx", "numba"), help="what runs the network (default: the checkpoint's)"
    )
    command.add_argument("--num-inference-steps", type=int, help="denoising steps (default: the checkpoint's)")
    command.add_argument(
        "--initial-noise-scale", type=float, help="scale of the first noise (default: the checkpoint's)"
    )
    command.add_argument("--seed", type=int, default=0, help="seed of what is drawn at random (default: 0)")
    command.add_argument("--overwrite", action="store_true", help="replace an existing result")


def policy_settings(arguments: argparse.Namespace) -> dict[str, Any]:
    """Settings of the policy that the flags change."""
    return {name: getattr(arguments, name) for name in _POLICY_SETTINGS if getattr(arguments, name) is not None}


def study_settings(arguments: argparse.Namespace) -> dict[str, Any]:
    """What the flags of `add_study_flags` say, as a result keeps it."""
    return {
        "actions_per_plan": arguments.actions_per_plan,
        "fps": arguments.fps,
        "hold": stride(arguments.fps),
        "step_limit": arguments.step_limit,
        "angular_acceleration_limit": ANGULAR_LIMITS[arguments.angular_limit],
        "seed": arguments.seed,
        "device": arguments.device,
    }


def planner_of(path: Path | str, arguments: argparse.Namespace) -> "Planner":
    """The checkpoint at `path` as the flags want it to plan.

    Raises:
        FileFormatError: no such checkpoint, or one without a setting that the flags change.
        InvalidValueError: it plans fewer actions than are to be executed.
    """
    from .planner import Planner  # torch

    planner = Planner(path, arguments.device, **policy_settings(arguments))
    available = planner.checkpoint.planned_frames
    if arguments.actions_per_plan > available:
        raise InvalidValueError("--actions-per-plan", f"at most the plan's {available}", arguments.actions_per_plan)
    planner.actions = arguments.actions_per_plan
    return planner


def physics_of(arguments: argparse.Namespace) -> Physics:
    """The world's settings behind the flags."""
    return Physics(ANGULAR_LIMITS[arguments.angular_limit], arguments.step_limit)


def require_positive(arguments: argparse.Namespace, *names: str) -> None:
    """
    Raises:
        InvalidValueError: a given flag below 1.
    """
    for name in names:
        if getattr(arguments, name) is not None and getattr(arguments, name) < 1:
            raise InvalidValueError(f"--{name.replace('_', '-')}", "at least 1", getattr(arguments, name))
