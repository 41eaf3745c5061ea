"""Flags that several studies of `copolicy-eval` share, and what they mean."""

import argparse
import logging
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
from copolicy.collect.agents.training_conditions import TrainingConditions, training_conditions
from copolicy.collect.angular_limit import ANGULAR_LIMITS, LIMIT, angular_limit_of, limited
from copolicy.dataset.clock import stride
from copolicy.dataset.command_line.extras import BACKEND_PACKAGES, FIGURES, POLICIES
from copolicy.dataset.command_line.flag_numbers import add_whole_number, number, seed
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import TABLE, PairTask, get_task

if TYPE_CHECKING:
    from copolicy.train.checkpoint import Checkpoint

_POLICY_SETTINGS = ("sampler", "num_inference_steps", "initial_noise_scale", "backend")


def add_study_flags(command: argparse.ArgumentParser, actions_per_plan: int) -> None:
    """Everything that a simulated study has beside its maps and its output."""
    add_whole_number(command, "--fps", "frames a second that plans are for (default: as the policy learned)")
    command.add_argument("--device", default="cpu", help="default: cpu")
    add_protocol_flags(command, actions_per_plan)


def add_protocol_flags(command: argparse.ArgumentParser, actions_per_plan: int) -> None:
    """How a robot plans, the world's settings, seed and `--overwrite`."""
    meaning = f"executed before replanning (default: {actions_per_plan})"
    add_whole_number(command, "--n-action-steps", meaning, actions_per_plan)
    add_whole_number(
        command, "--step-limit", "steps until a time-out (default: the task's; of the table 2000, of 1/30 s)"
    )
    limit = "bound on the angular acceleration, rad/s^2 (default: what the policy learned with)"
    command.add_argument("--angular-limit", choices=ANGULAR_LIMITS, help=limit)
    samplers, backends = ("ddpm", "ddim", "dpmsolver++"), ("auto", "torch", "onnx", "numba")
    command.add_argument("--sampler", choices=samplers, help="denoising (default: the checkpoint's)")
    command.add_argument("--backend", choices=backends, help="what runs the network (default: the checkpoint's)")
    steps = "denoising steps (default: the checkpoint's)"
    add_whole_number(command, "--num-inference-steps", steps, None, 1, 1000)
    scale, noise = number("--initial-noise-scale", 0, 10), "scale of the first noise (default: the checkpoint's)"
    command.add_argument("--initial-noise-scale", type=scale, help=noise)
    command.add_argument("--seed", type=seed(), default=0, help="seed of what is drawn at random (default: 0)")
    command.add_argument("--overwrite", action="store_true", help="replace an existing result")


def study_needs(arguments: argparse.Namespace) -> tuple[str, ...]:
    """Packages of a simulated study: those of its policy, of the backend asked for, and of its figure."""
    return (*POLICIES, *FIGURES, *BACKEND_PACKAGES.get(arguments.backend, ()))


def policy_settings(arguments: argparse.Namespace) -> dict[str, Any]:
    """Settings of the policy that the flags change."""
    return {name: getattr(arguments, name) for name in _POLICY_SETTINGS if getattr(arguments, name) is not None}


def learned_task(path: Path | str) -> PairTask:
    """The task that a checkpoint learned, from its files alone.

    Raises:
        FileFormatError: no such checkpoint.
        UnknownNameError: the task is not installed.
    """
    return get_task(training_conditions(checkpoint_folder(path)).task)


@dataclass(frozen=True)
class Protocol:
    """Task, rate and physics of a study: those that the policy learned at, unless the flags say otherwise.

    Attributes:
        fps: frames a second that the first policy's plans are for.
        physics: of the world.
        told_otherwise: what the flags contradict, in words.
    """

    task: PairTask
    fps: int
    physics: Any
    told_otherwise: tuple[str, ...] = ()


def protocol_of(arguments: argparse.Namespace, policies: Iterable[tuple[str, TrainingConditions]]) -> Protocol:
    """What a study runs at; says what is assumed, and where a flag contradicts a policy.

    Args:
        policies: name and conditions of each, the one that the study is about first.

    Raises:
        InvalidValueError: a rate that the world cannot be divided by, policies of several tasks, a flag that their task
            has not, or policies that learned under different physics and no flag that decides.
    """
    named = list(policies)
    for name, conditions in named:
        for note in conditions.notes:
            logging.info("%s: %s", name, note)
    task = _one_task({name: conditions.task for name, conditions in named})
    usual, limit_flag = usual_settings(task, arguments.step_limit), arguments.angular_limit
    worlds = {name: replace(conditions.physics, step_limit=usual.step_limit) for name, conditions in named}
    if limit_flag is None and len(set(worlds.values())) > 1:
        found = {name: task.settings_summary(world) for name, world in worlds.items()}
        if angular_limit_of(usual) is not None:
            expected = "a choice, since the policies learned under different physics"
            raise InvalidValueError("--angular-limit", expected, found)
        raise InvalidValueError("policies", "ones that learned under the same settings of the world", found)
    physics = next(iter(worlds.values()), usual)
    contradictions: list[str] = []
    if limit_flag is not None:
        physics = limited(task, physics, limit_flag)
        contradictions += [
            f"--angular-limit {limit_flag}: {name} learned with {limit:.4g} rad/s^2"
            for name, limit in ((name, getattr(world, LIMIT)) for name, world in worlds.items())
            if not math.isclose(limit, ANGULAR_LIMITS[limit_flag])
        ]
    fps_flag = getattr(arguments, "fps", None)
    if fps_flag is not None:
        contradictions += [
            f"--fps {fps_flag}: {name} learned from {conditions.fps:g} frames a second"
            for name, conditions in named
            if conditions.fps != fps_flag
        ]
    for line in contradictions:
        logging.warning("warning: %s", line)
    fps = fps_flag if fps_flag is not None else next((conditions.fps for _, conditions in named), 10)
    stride(fps, task.spec.record_hz)
    return Protocol(task, fps, physics, tuple(contradictions))


def _one_task(tasks: Mapping[str, str]) -> PairTask:
    if len(set(tasks.values())) > 1:
        raise InvalidValueError("policies", "ones that learned the same task", dict(tasks))
    return get_task(next(iter(tasks.values()), TABLE))


def usual_settings(task: PairTask, step_limit: int | None = None) -> Any:
    """The task's usual settings, with the limit of steps that is asked for or that its studies have."""
    steps = step_limit or task.studies.step_limit
    return task.settings_type() if steps is None else replace(task.settings_type(), step_limit=steps)


def stated_settings(task: PairTask, physics: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """What results and plans state of a world: those that flags set, and all where others are unusual."""
    names = [field.name for field in fields(physics) if field.name in ("step_limit", LIMIT)]
    stated = {name: getattr(physics, name) for name in sorted(names, reverse=True)}
    return stated, ({} if physics == task.settings_type(**stated) else {"physics": asdict(physics)})


def study_settings(arguments: argparse.Namespace, protocol: Protocol, scenarios: Sequence[Any]) -> dict[str, Any]:
    """What a study of `add_study_flags` ran at, as a result keeps it.

    Args:
        scenarios: that it ran on; says, and states, what the policies cannot see of them.
    """
    stated, unusual = stated_settings(protocol.task, protocol.physics)
    return {
        **task_entry(protocol.task),
        "actions_per_plan": arguments.n_action_steps,
        "fps": protocol.fps,
        "hold": stride(protocol.fps, protocol.task.spec.record_hz),
        **stated,
        "seed": arguments.seed,
        "device": arguments.device,
        **unusual,
        **({"told_otherwise": list(protocol.told_otherwise)} if protocol.told_otherwise else {}),
        **unseen_entry(protocol.task, scenarios),
    }


def task_entry(task: PairTask) -> dict[str, str]:
    """How a result names its task; one that names none is of the table."""
    return {} if task.spec.name == TABLE else {"task": task.spec.name}


def unseen_entry(task: PairTask, scenarios: Sequence[Any]) -> dict[str, str]:
    """What policies do not see of some scenarios, as a result states it; says so."""
    text = task.unseen_in([task.columns_of(scenario) for scenario in scenarios])
    if text:
        logging.warning("warning: of the maps, %s", text)
    return {"unseen": text} if text else {}


def policy_of(path: Path | str, arguments: argparse.Namespace) -> "Checkpoint":
    """The checkpoint at `path` as the flags want it to act.

    Raises:
        FileFormatError: no such checkpoint, or one without a setting that the flags change.
        InvalidValueError: its chunks hold fewer actions than are to be executed.
    """
    from copolicy.train.checkpoint import Checkpoint  # torch

    policy = Checkpoint(path, arguments.device, policy_settings(arguments))
    if arguments.n_action_steps > policy.chunk_size:
        raise InvalidValueError("--n-action-steps", f"at most the plan's {policy.chunk_size}", arguments.n_action_steps)
    policy.n_action_steps = policy.wanted = arguments.n_action_steps
    return policy
