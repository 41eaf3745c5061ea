"""Checkpoints of a training of Co-GAIL: LeRobot's folders, and the state that LeRobot does not know."""

import shutil
from pathlib import Path
from typing import Any

import torch
from lerobot.common.train_utils import (
    get_step_checkpoint_dir,
    load_training_step,
    save_training_state,
    update_last_checkpoint,
)
from lerobot.configs.train import TrainPipelineConfig
from lerobot.policies.factory import make_pre_post_processors
from lerobot.utils.constants import PRETRAINED_MODEL_DIR, TRAINING_STATE_DIR
from lerobot.utils.random_utils import load_rng_state

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.staging import replacement
from lerobot_policy_copolicy.cogail.modeling_cogail import CoGailPolicy

from ..finite_training import link_last_checkpoint
from ..training_data import write_training_data

STATE_FILE = "cogail_state.pt"
"""In `training_state`: optimizers, discriminator, scale of the reward, worlds."""


def write_checkpoint(
    config: TrainPipelineConfig, step: int, policy: CoGailPolicy, state: dict[str, Any], data: dict[str, Any]
) -> Path:
    """Writes a checkpoint, and links `checkpoints/last` to it when it is complete.

    Args:
        state: what LeRobot's training state lacks.
        data: content of `training_data.json`; empty for a data set without pairs.

    Raises:
        NonFiniteError: a weight is NaN or infinite.
    """
    assert config.output_dir is not None
    folder = get_step_checkpoint_dir(config.output_dir, config.steps, step)
    if folder.is_dir():  # of a run that ended while it wrote, before `last` was linked
        shutil.rmtree(folder)
    policy.save_pretrained(folder / PRETRAINED_MODEL_DIR)
    config.save_pretrained(folder / PRETRAINED_MODEL_DIR)
    for processor in make_pre_post_processors(policy.config):
        processor.save_pretrained(folder / PRETRAINED_MODEL_DIR)
    if data:
        write_training_data(folder / PRETRAINED_MODEL_DIR, data)
    save_training_state(folder, step)
    with replacement(folder / TRAINING_STATE_DIR / STATE_FILE) as partial:
        torch.save(state, partial)
    link_last_checkpoint(folder, update_last_checkpoint)  # pyright: ignore[reportArgumentType]
    return folder


def read_checkpoint(folder: Path) -> tuple[int, dict[str, Any]]:
    """The step and the state of a checkpoint; sets all random numbers as they were.

    Raises:
        FileFormatError: the checkpoint has no such state.
    """
    path = folder / TRAINING_STATE_DIR / STATE_FILE
    if not path.is_file():
        raise FileFormatError(path, "the training state of copolicy-train cogail", "no such file")
    try:
        state = torch.load(path, weights_only=True, map_location="cpu")
        load_rng_state(path.parent)
        step = load_training_step(path.parent)
    except Exception as error:
        text = " ".join(str(error).split())
        raise FileFormatError(path, "a complete training state", f"{type(error).__name__}: {text[:200]}") from None
    return step, state
