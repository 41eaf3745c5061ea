"""LeRobot's training loop, stopped at the first loss, gradient or weight that is not finite."""

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


def guarded(config: TrainPipelineConfig, original: Mapping[str, Callable]) -> dict[str, Callable]:
    """What takes the place of functions of LeRobot's trainer, by name, while a run is trained.

    Args:
        config: of the run.
        original: `update_policy`, `save_checkpoint`, `update_last_checkpoint` and `make_policy`.
    """

    def update_policy(tracker: Any, policy: Any, *arguments: Any, **more: Any) -> Any:
        step = tracker.steps + 1
        try:
            result = original["update_policy"](tracker, policy, *arguments, **more)
        except NonFiniteLossError as error:  # the policy's own check, which may not know of an earlier run's steps
            raise _stopped(config, step, f"expected a finite loss, found {error.value}") from None
        accelerator = more.get("accelerator")
        # With float16 a gradient that overflows is normal: its step is left out and the scale made smaller.
        scaled = getattr(accelerator, "scaler", None) is not None
        for name, value in (("loss", tracker.loss.val), *(() if scaled else (("gradient", tracker.grad_norm.val),))):
            if not math.isfinite(value):
                raise _stopped(config, step, f"expected a finite {name}, found {value}")
        return result

    def save_checkpoint(*, step: int, policy: Any, model_state_dict: Any = None, **more: Any) -> None:
        unusable = non_finite_weight(policy.state_dict() if model_state_dict is None else model_state_dict)
        if unusable:
            raise _stopped(config, step, f"expected finite weights, found {unusable}")
        original["save_checkpoint"](step=step, policy=policy, model_state_dict=model_state_dict, **more)

    def update_last_checkpoint(checkpoint_dir: Path) -> Path:
        return link_last_checkpoint(checkpoint_dir, original["update_last_checkpoint"])

    def make_policy(*arguments: Any, **more: Any) -> Any:
        policy = original["make_policy"](*arguments, **more)
        unusable = non_finite_weight(policy.state_dict())
        if unusable:
            path = getattr(more.get("cfg"), "pretrained_path", None) or "the new policy"
            raise FileFormatError(path, "finite weights to start from", unusable)
        return policy

    return {
        "update_policy": update_policy,
        "save_checkpoint": save_checkpoint,
        "update_last_checkpoint": update_last_checkpoint,
        "make_policy": make_policy,
    }


def link_last_checkpoint(checkpoint_dir: Path, link: Callable[[Path], Path]) -> Path:
    """Makes `checkpoints/last` lead to a checkpoint, also in a run that was copied without links.

    What stands in the place of the link is kept under another name. Where no link can be made there is none: the run is
    then found by its highest number.

    Args:
        link: LeRobot's function, which replaces a link and nothing else.
    """
    last = checkpoint_dir.parent / "last"
    if last.exists() and not last.is_symlink():
        aside = next(
            path for number in range(1, 1000) if not (path := last.with_name(f"last-copied-{number}")).exists()
        )
        last.rename(aside)
        logging.warning("%s was no link, as in a run copied without links; it is %s now", last, aside.name)
    try:
        return link(checkpoint_dir)
    except OSError as error:
        logging.warning("%s: no link can be made here (%s); the newest checkpoint is %s", last, error, checkpoint_dir)
        return last


def _stopped(config: TrainPipelineConfig, step: int, what: str) -> NonFiniteError:
    folder = find_policy_folder(Path(config.output_dir or ""))
    left = f"the last checkpoint is {folder.parent}" if folder else "no checkpoint was written"
    return NonFiniteError(f"training stopped at step {step}: {what}; {left}")
