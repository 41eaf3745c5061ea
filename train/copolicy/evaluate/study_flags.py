"""Flags that the studies of `copolicy-eval` share, and the protocol that follows from them."""

import argparse
import logging
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
from copolicy.collect.agents.training_conditions import TrainingConditions, training_conditions
from copolicy.collect.angular_limit import ANGULAR_LIMITS, LIMIT_SETTING, angular_limit_of, with_angular_limit
from copolicy.dataset.clock import stride
from copolicy.dataset.command_line.extras import BACKEND_PACKAGES, FIGURES, POLICIES
from copolicy.dataset.command_line.flag_numbers import add_whole_number, number, seed
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import TABLE, PairTask, get_task

if TYPE_CHECKING:
    from copolicy.train.checkpoint import Checkpoint

POLICY_HELP = "folder of a training run or a checkpoint, or pretrained (the model in the package)"
POLICY_SETTINGS = ("sampler", "num_inference_steps", "initial_noise_scale", "backend", "code")
"""Settings of a policy that flags override."""


def figure_beside(result: Path) -> Path:
    """Name of the figure beside a result file.

    Raises:
        InvalidValueError: the result's name does not end with .json, so that the figure might have the same name.
    """
    if result.suffix.lower() != ".json":
        raise InvalidValueError("--out", "a name that ends with .json", str(result))
    return result.with_suffix(".png")


def add_study_flags(command: argparse.ArgumentParser, n_action_steps: int) -> None:
    """Adds the flags of a simulated study other than its maps and its output."""
    add_whole_number(command, "--fps", "actions per second (default: the rate of the policy's training data)")
    command.add_argument("--device", default="cpu", help="default: cpu")
    add_protocol_flags(command, n_action_steps)


def add_protocol_flags(
    command: argparse.ArgumentParser, n_action_steps: int, overwrite: str = "replace an existing result"
) -> None:
    """Adds the flags of inference, of the world's settings, `--seed` and `--overwrite`, with the help of the last."""
    samplers, backends = ("ddpm", "ddim", "dpmsolver++"), ("auto", "torch", "onnx", "numba")
    command.add_argument("--sampler", choices=samplers, help="diffusion sampler (default: the checkpoint's)")
    command.add_argument("--backend", choices=backends, help="runs the network (default: the checkpoint's)")
    steps = "denoising steps (default: the checkpoint's)"
    add_whole_number(command, "--num-inference-steps", steps, None, 1, 1000)
    scale, noise = number("--initial-noise-scale", 0, 10), "scale of the initial noise (default: the checkpoint's)"
    command.add_argument("--initial-noise-scale", type=scale, help=noise)
    codes = ("drawn", "inferred", "episode")
    command.add_argument("--code", choices=codes, help="how cogail gets its code (default: the checkpoint's)")
    add_world_flags(command, n_action_steps)
    command.add_argument("--overwrite", action="store_true", help=overwrite)


def add_world_flags(command: argparse.ArgumentParser, n_action_steps: int) -> None:
    """Adds the flags of executed actions, of the world's settings and `--seed`."""
    shorter = ", or all of a shorter chunk" if n_action_steps > 1 else ""
    meaning = f"actions executed of each action chunk (default: {n_action_steps}{shorter})"
    # Without the flag, `study_policy` limits the number to the length of the policy's chunks.
    add_whole_number(command, "--n-action-steps", meaning, None if shorter else n_action_steps)
    command.set_defaults(default_n_action_steps=n_action_steps)
    add_whole_number(
        command, "--step-limit", "steps until a time-out (default: the task's; for the table 2000 steps of 1/30 s)"
    )
    limit = "limit of the angular acceleration, rad/s^2 (default: that of the policy's training data)"
    command.add_argument("--angular-limit", choices=ANGULAR_LIMITS, help=limit)
    command.add_argument("--seed", type=seed(), default=0, help="seed of the random numbers (default: 0)")


def study_needs(arguments: argparse.Namespace) -> tuple[str, ...]:
    """Packages that a simulated study needs: those of its policy, its backend and its figure."""
    return (*POLICIES, *FIGURES, *BACKEND_PACKAGES.get(arguments.backend, ()))


def policy_settings(arguments: argparse.Namespace) -> dict[str, Any]:
    """Settings of the policy that the flags override."""
    return {name: getattr(arguments, name) for name in POLICY_SETTINGS if getattr(arguments, name) is not None}


def checkpoint_task(path: Path | str) -> PairTask:
    """The task of a checkpoint, read from its files without loading the weights.

    Raises:
        FileFormatError: the checkpoint does not exist.
        UnknownNameError: the task is not installed.
    """
    return get_task(training_conditions(checkpoint_folder(path)).task)


@dataclass(frozen=True)
class Protocol:
    """Task, rate and world settings of a study: those of the policy's training data, unless flags override them.

    Attributes:
        fps: actions per second of the first policy.
        settings: settings of the world.
        contradictions: one sentence for each flag value that differs from a policy's training data.
    """

    task: PairTask
    fps: int
    settings: Any
    contradictions: tuple[str, ...] = ()


def study_protocol(arguments: argparse.Namespace, policies: Iterable[tuple[str, TrainingConditions]]) -> Protocol:
    """Determines the protocol of a study; logs assumptions, and warns where a flag contradicts a policy.

    Args:
        policies: name and training conditions of each policy, the evaluated one first.

    Raises:
        InvalidValueError: a rate that does not divide the task's, policies of several tasks, a flag that the task does
            not have, or policies trained under different world settings without a flag that chooses one.
    """
    policies = list(policies)
    for name, conditions in policies:
        for note in conditions.notes:
            logging.info("%s: %s", name, note)
    task = _one_task({name: conditions.task for name, conditions in policies})
    default, limit_flag = default_settings(task, arguments.step_limit), arguments.angular_limit
    learned = {name: replace(conditions.settings, step_limit=default.step_limit) for name, conditions in policies}
    if limit_flag is None and len(set(learned.values())) > 1:
        summaries = {name: task.settings_summary(settings) for name, settings in learned.items()}
        if angular_limit_of(default) is not None:
            expected = "a choice, since the policies learned under different physics"
            raise InvalidValueError("--angular-limit", expected, summaries)
        raise InvalidValueError("policies", "ones that learned under the same settings of the world", summaries)
    settings = next(iter(learned.values()), default)
    contradictions: list[str] = []
    if limit_flag is not None:
        settings = with_angular_limit(task, settings, limit_flag)
        contradictions += [
            f"--angular-limit {limit_flag}: {name} learned with {limit:.4g} rad/s^2"
            for name, limit in ((name, getattr(world, LIMIT_SETTING)) for name, world in learned.items())
            if not math.isclose(limit, ANGULAR_LIMITS[limit_flag])
        ]
    fps_flag = getattr(arguments, "fps", None)
    if fps_flag is not None:
        contradictions += [
            f"--fps {fps_flag}: {name} learned from {conditions.fps:g} frames a second"
            for name, conditions in policies
            if conditions.fps != fps_flag
        ]
    for line in contradictions:
        logging.warning("warning: %s", line)
    fps = fps_flag if fps_flag is not None else next((conditions.fps for _, conditions in policies), 10)
    stride(fps, task.spec.record_hz)
    return Protocol(task, fps, settings, tuple(contradictions))


def _one_task(tasks: Mapping[str, str]) -> PairTask:
    if len(set(tasks.values())) > 1:
        raise InvalidValueError("policies", "ones that learned the same task", dict(tasks))
    return get_task(next(iter(tasks.values()), TABLE))


def default_settings(task: PairTask, step_limit: int | None = None) -> Any:
    """The task's default settings, with the given step limit or else that of the task's studies."""
    steps = step_limit or task.studies.step_limit
    return task.settings_type() if steps is None else replace(task.settings_type(), step_limit=steps)


def recorded_settings(task: PairTask, settings: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """World settings for a result or a study plan: those that flags set, and all of them if others are not default."""
    names = [field.name for field in fields(settings) if field.name in ("step_limit", LIMIT_SETTING)]
    flagged = {name: getattr(settings, name) for name in sorted(names, reverse=True)}
    return flagged, ({} if settings == task.settings_type(**flagged) else {"physics": asdict(settings)})


def study_settings(arguments: argparse.Namespace, protocol: Protocol, scenarios: Sequence[Any]) -> dict[str, Any]:
    """The `settings` entry of a result, for a study with the flags of `add_study_flags`.

    Args:
        scenarios: scenarios of the study; properties of these that policies do not observe are logged and recorded.
    """
    flagged, unusual = recorded_settings(protocol.task, protocol.settings)
    return {
        **task_entry(protocol.task),
        "actions_per_plan": arguments.n_action_steps,
        "fps": protocol.fps,
        "hold": stride(protocol.fps, protocol.task.spec.record_hz),
        **flagged,
        "seed": arguments.seed,
        "device": arguments.device,
        **unusual,
        **({"told_otherwise": list(protocol.contradictions)} if protocol.contradictions else {}),
        **unseen_entry(protocol.task, scenarios),
    }


def task_entry(task: PairTask) -> dict[str, str]:
    """The `task` entry of a result; a result without it is of the table."""
    return {} if task.spec.name == TABLE else {"task": task.spec.name}


def unseen_entry(task: PairTask, scenarios: Sequence[Any]) -> dict[str, str]:
    """The `unseen` entry of a result: properties of the scenarios that policies do not observe; logs a warning."""
    text = task.unseen_summary([task.columns_of(scenario) for scenario in scenarios])
    if text:
        logging.warning("warning: of the maps, %s", text)
    return {"unseen": text} if text else {}


def study_policy(path: Path | str, arguments: argparse.Namespace) -> "Checkpoint":
    """Loads a checkpoint with the settings that the flags override.

    Raises:
        FileFormatError: the checkpoint does not exist, or lacks a setting that a flag overrides.
        InvalidValueError: its chunks have fewer actions than are to be executed.
    """
    from copolicy.train.checkpoint import Checkpoint  # torch

    policy = Checkpoint(path, arguments.device, policy_settings(arguments))
    if arguments.n_action_steps is None:
        arguments.n_action_steps = min(arguments.default_n_action_steps, policy.chunk_size)
    if arguments.n_action_steps > policy.chunk_size:
        expected = f"1 to {policy.chunk_size}, the actions of a chunk"
        raise InvalidValueError("--n-action-steps", expected, arguments.n_action_steps)
    policy.n_action_steps = policy.n_predicted_actions = arguments.n_action_steps
    return policy
