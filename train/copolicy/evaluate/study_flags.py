"""Flags that several studies of `copolicy-eval` share, and what they mean."""

import argparse
import logging
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from copolicy.collect.agents.training_conditions import TrainingConditions
from copolicy.dataset.clock import stride
from copolicy.dataset.command_line.extras import BACKEND_PACKAGES, FIGURES, POLICIES
from copolicy.dataset.command_line.flag_numbers import number, seed, whole_number
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.tasks.table.physics import Physics

if TYPE_CHECKING:
    from copolicy.train.checkpoint import Checkpoint

ANGULAR_LIMITS = {"pi/2": math.pi / 2, "pi/8": math.pi / 8}
_POLICY_SETTINGS = ("sampler", "num_inference_steps", "initial_noise_scale", "backend")


def add_study_flags(command: argparse.ArgumentParser, actions_per_plan: int) -> None:
    """Everything that a simulated study has beside its maps and its output."""
    command.add_argument(
        "--fps", type=whole_number("--fps"), help="frames a second that plans are for (default: as the policy learned)"
    )
    command.add_argument("--device", default="cpu", help="default: cpu")
    add_protocol_flags(command, actions_per_plan)


def add_protocol_flags(command: argparse.ArgumentParser, actions_per_plan: int) -> None:
    """How a robot plans, the world's settings, seed and `--overwrite`."""
    command.add_argument(
        "--actions-per-plan",
        type=whole_number("--actions-per-plan"),
        default=actions_per_plan,
        help=f"executed before replanning (default: {actions_per_plan})",
    )
    command.add_argument(
        "--step-limit",
        type=whole_number("--step-limit"),
        default=2000,
        help="30 Hz steps until a time-out (default: 2000)",
    )
    command.add_argument(
        "--angular-limit",
        choices=ANGULAR_LIMITS,
        help="bound on the angular acceleration, rad/s^2 (default: what the policy learned with)",
    )
    command.add_argument(
        "--sampler", choices=("ddpm", "ddim", "dpmsolver++"), help="denoising (default: the checkpoint's)"
    )
    command.add_argument(
        "--backend",
        choices=("auto", "torch", "onnx", "numba"),
        help="what runs the network (default: the checkpoint's)",
    )
    command.add_argument(
        "--num-inference-steps",
        type=whole_number("--num-inference-steps", 1, 1000),
        help="denoising steps (default: the checkpoint's)",
    )
    command.add_argument(
        "--initial-noise-scale",
        type=number("--initial-noise-scale", 0, 10),
        help="scale of the first noise (default: the checkpoint's)",
    )
    command.add_argument("--seed", type=seed(), default=0, help="seed of what is drawn at random (default: 0)")
    command.add_argument("--overwrite", action="store_true", help="replace an existing result")


def study_needs(arguments: argparse.Namespace) -> tuple[str, ...]:
    """Packages of a simulated study: those of its policy, of the backend asked for, and of its figure."""
    return (*POLICIES, *FIGURES, *BACKEND_PACKAGES.get(arguments.backend, ()))


def policy_settings(arguments: argparse.Namespace) -> dict[str, Any]:
    """Settings of the policy that the flags change."""
    return {name: getattr(arguments, name) for name in _POLICY_SETTINGS if getattr(arguments, name) is not None}


@dataclass(frozen=True)
class Protocol:
    """Rate and physics of a study: those that the policy learned at, unless the flags say otherwise.

    Attributes:
        fps: frames a second that the first policy's plans are for.
        physics: of the world.
        told_otherwise: what the flags contradict, in words.
    """

    fps: int
    physics: Physics
    told_otherwise: tuple[str, ...] = ()


def protocol_of(arguments: argparse.Namespace, policies: Iterable[tuple[str, TrainingConditions]]) -> Protocol:
    """What a study runs at; says what is assumed, and where a flag contradicts a policy.

    Args:
        policies: name and conditions of each, the one that the study is about first.

    Raises:
        InvalidValueError: a rate that the world cannot be divided by, or policies that learned under different physics
            and no flag that decides.
    """
    named = list(policies)
    for name, conditions in named:
        for note in conditions.notes:
            logging.info("%s: %s", name, note)
    fps_flag = getattr(arguments, "fps", None)
    limit_flag = None if arguments.angular_limit is None else ANGULAR_LIMITS[arguments.angular_limit]
    worlds = {name: replace(conditions.physics, step_limit=arguments.step_limit) for name, conditions in named}
    if limit_flag is None and len(set(worlds.values())) > 1:
        limits = {name: round(world.angular_acceleration_limit, 4) for name, world in worlds.items()}
        raise InvalidValueError(
            "--angular-limit", "a choice, since the policies learned under different physics", limits
        )
    physics = next(iter(worlds.values()), Physics(step_limit=arguments.step_limit))
    contradictions: list[str] = []
    if limit_flag is not None:
        physics = replace(physics, angular_acceleration_limit=limit_flag)
        contradictions += [
            f"--angular-limit {arguments.angular_limit}: {name} learned with {limit:.4g} rad/s^2"
            for name, limit in ((name, world.angular_acceleration_limit) for name, world in worlds.items())
            if not math.isclose(limit, limit_flag)
        ]
    if fps_flag is not None:
        contradictions += [
            f"--fps {fps_flag}: {name} learned from {conditions.fps:g} frames a second"
            for name, conditions in named
            if conditions.fps != fps_flag
        ]
    for line in contradictions:
        logging.warning("warning: %s", line)
    fps = fps_flag if fps_flag is not None else next((conditions.fps for _, conditions in named), 10)
    stride(fps)
    return Protocol(fps, physics, tuple(contradictions))


def study_settings(arguments: argparse.Namespace, protocol: Protocol) -> dict[str, Any]:
    """What a study of `add_study_flags` ran at, as a result keeps it."""
    usual = replace(
        Physics(step_limit=arguments.step_limit),
        angular_acceleration_limit=protocol.physics.angular_acceleration_limit,
    )
    return {
        "actions_per_plan": arguments.actions_per_plan,
        "fps": protocol.fps,
        "hold": stride(protocol.fps),
        "step_limit": arguments.step_limit,
        "angular_acceleration_limit": protocol.physics.angular_acceleration_limit,
        "seed": arguments.seed,
        "device": arguments.device,
        **({} if protocol.physics == usual else {"physics": asdict(protocol.physics)}),
        **({"told_otherwise": list(protocol.told_otherwise)} if protocol.told_otherwise else {}),
    }


def policy_of(path: Path | str, arguments: argparse.Namespace) -> "Checkpoint":
    """The checkpoint at `path` as the flags want it to act.

    Raises:
        FileFormatError: no such checkpoint, or one without a setting that the flags change.
        InvalidValueError: its chunks hold fewer actions than are to be executed.
    """
    from copolicy.train.checkpoint import Checkpoint  # torch

    policy = Checkpoint(path, arguments.device, policy_settings(arguments))
    if arguments.actions_per_plan > policy.chunk_size:
        raise InvalidValueError(
            "--actions-per-plan", f"at most the plan's {policy.chunk_size}", arguments.actions_per_plan
        )
    policy.n_action_steps = policy.wanted = arguments.actions_per_plan
    return policy
