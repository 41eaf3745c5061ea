"""Stops LeRobot's training loop at the first loss, gradient or weight that is not finite."""

import logging
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from lerobot.configs.train import TrainPipelineConfig

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.policies.training_run import find_policy_folder

from .finite_data import NonFiniteError, NonFiniteLossError
from .finite_weights import non_finite_weight


def guarded_functions(config: TrainPipelineConfig, original: Mapping[str, Callable]) -> dict[str, Callable]:
    """Replacements, by name, for functions of LeRobot's trainer that also check that numbers are finite.

    Args:
        config: configuration of the run.
        original: LeRobot's `update_policy`, `save_checkpoint`, `update_last_checkpoint` and `make_policy`.
    """

    def update_policy(tracker: Any, policy: Any, *arguments: Any, **kwargs: Any) -> Any:
        step = tracker.steps + 1
        try:
            result = original["update_policy"](tracker, policy, *arguments, **kwargs)
        except NonFiniteLossError as error:  # the policy's own check, whose step count starts anew in a resumed run
            raise _stopped(config, step, f"expected a finite loss, found {error.value}") from None
        accelerator = kwargs.get("accelerator")
        # With float16 an overflowing gradient is normal: the scaler skips the step and lowers the scale.
        scaled = getattr(accelerator, "scaler", None) is not None
        for name, value in (("loss", tracker.loss.val), *(() if scaled else (("gradient", tracker.grad_norm.val),))):
            if not math.isfinite(value):
                raise _stopped(config, step, f"expected a finite {name}, found {value}")
        return result

    def save_checkpoint(*, step: int, policy: Any, model_state_dict: Any = None, **kwargs: Any) -> None:
        non_finite = non_finite_weight(policy.state_dict() if model_state_dict is None else model_state_dict)
        if non_finite:
            raise _stopped(config, step, f"expected finite weights, found {non_finite}")
        original["save_checkpoint"](step=step, policy=policy, model_state_dict=model_state_dict, **kwargs)

    def update_last_checkpoint(checkpoint_dir: Path) -> Path:
        return link_last_checkpoint(checkpoint_dir, original["update_last_checkpoint"])

    def make_policy(*arguments: Any, **kwargs: Any) -> Any:
        policy = original["make_policy"](*arguments, **kwargs)
        non_finite = non_finite_weight(policy.state_dict())
        if non_finite:
            path = getattr(kwargs.get("cfg"), "pretrained_path", None) or "the new policy"
            raise FileFormatError(path, "finite weights to start from", non_finite)
        return policy

    return {
        "update_policy": update_policy,
        "save_checkpoint": save_checkpoint,
        "update_last_checkpoint": update_last_checkpoint,
        "make_policy": make_policy,
    }


def link_last_checkpoint(checkpoint_dir: Path, link: Callable[[Path], Path]) -> Path:
    """Makes `checkpoints/last` link to a checkpoint, also in a run that was copied without links.

    A file or folder in place of the link is renamed. On a file system without links none is made; the checkpoint with
    the highest number is then the newest.

    Args:
        link: LeRobot's function, which replaces only a link.
    """
    last = checkpoint_dir.parent / "last"
    if last.exists() and not last.is_symlink():
        renamed = next(
            path for number in range(1, 1000) if not (path := last.with_name(f"last-copied-{number}")).exists()
        )
        last.rename(renamed)
        logging.warning("%s was no link, as in a run copied without links; renamed to %s", last, renamed.name)
    try:
        return link(checkpoint_dir)
    except OSError as error:
        logging.warning("%s: no link can be made here (%s); the newest checkpoint is %s", last, error, checkpoint_dir)
        return last


def _stopped(config: TrainPipelineConfig, step: int, problem: str) -> NonFiniteError:
    folder = find_policy_folder(Path(config.output_dir or ""))
    checkpoint = f"the last checkpoint is {folder.parent}" if folder else "no checkpoint was written"
    return NonFiniteError(f"training stopped at step {step}: {problem}; {checkpoint}")
