"""What every policy for two players does with its data and its weights, whatever its network."""

import logging
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import torch
from lerobot.policies import PreTrainedPolicy
from torch import Tensor

from copolicy.dataset.exceptions import InvalidValueError, RunError, ShapeError
from copolicy.dataset.features import ACTION, features_of
from copolicy.dataset.lerobot_folder.info import task_of
from copolicy.dataset.task import PairTask, get_task
from copolicy.train.finite_data import NonFiniteError, NonFiniteLossError
from copolicy.train.finite_weights import non_finite_weight

from .configuration_pair import PairPolicyConfig
from .features import AbsoluteFeatures, ActionScale, RawFeatures
from .training_data import prepare_training, require_same_rate

_EPISODE = "episode_index"


class PairPolicy(PreTrainedPolicy):
    """A policy that predicts the actions of both players from columns of our data sets.

    Inputs and outputs are in the units of the task, [-1, 1] for actions of the table; they are scaled by the bounds of
    the task inside the policy.

    Attributes:
        features: encodes observation columns `(..., n)` into network inputs `(..., features.size)`.
        action_scale: scales joint actions to [-1, 1] and back.
        symmetries: functions that augment training samples, see `PolicyFeatures`.
    """

    config_class = PairPolicyConfig  # pyright: ignore[reportAssignmentType]
    name = "pair_policy"  # pyright: ignore[reportAssignmentType]
    config: Any  # of the subclass
    features: Any
    action_scale: ActionScale

    def __init__(self, config: PairPolicyConfig, **kwargs):
        super().__init__(config)
        meta = kwargs.get("dataset_meta")
        if meta is not None:
            config.use_task(task_of({"robot_type": getattr(meta, "robot_type", None)}))
        config.validate_features()
        task = get_task(config.filled.task)
        self._sizes = {name: column["shape"][0] for name, column in features_of(task.spec).items()}
        offered = task.features
        self.symmetries = [augment for name, augment in offered.symmetries.items() if name in config.used_symmetries]
        # Excluded episodes, to be refused in a batch if the constructor cannot find out the episodes of the training.
        self._excluded = torch.tensor(sorted(prepare_training(config, meta)) if meta is not None else [])
        require_same_rate(config)
        self._loss: Tensor | None = None  # of the last step, until it is checked
        self._updates = 0
        unused = sorted((config.input_features or {}).keys() - set(config.observation_keys))
        if unused:
            logging.info("%s does not read %s", config.type, ", ".join(unused))
        self.features = self._make_features(task)
        self.action_scale = ActionScale(task.spec)

    def _make_features(self, task: PairTask) -> Any:
        """The encoder with the name `observation_features`; a subclass with encoders of its own overrides it."""
        generic: dict[str, Callable] = {"absolute": AbsoluteFeatures, "raw": RawFeatures}
        encoders = {**task.features.encoders, **{name: partial(make, task.spec) for name, make in generic.items()}}
        return encoders[self.config.filled.observation_features](self.config.filled.past_human_action)

    def update(self) -> None:
        """LeRobot's trainer calls this after each optimizer step.

        Raises:
            NonFiniteLossError: the loss of that step is NaN or infinite.
        """
        self._updates += 1
        # The trainer reads the loss next, so synchronising with the GPU here costs nothing.
        self._require_finite_loss()

    def save_pretrained(self, save_directory: str | Path, **settings) -> str | None:
        """LeRobot's method, with a check of the weights.

        Raises:
            NonFiniteError: a weight is NaN or infinite; nothing is written.
        """
        state = settings.get("state_dict")
        non_finite = non_finite_weight(self.state_dict() if state is None else state)
        if non_finite:
            raise NonFiniteError(f"{save_directory}: expected finite weights to save, found {non_finite}")
        return super().save_pretrained(save_directory, **settings)

    def _training_sample(self, batch: dict[str, Tensor], frames: int, actions: int) -> dict[str, Tensor]:
        """The columns of a batch, checked, and augmented by the symmetries in training.

        Args:
            frames: length of the observation columns.
            actions: length of the action column.

        Raises:
            InvalidValueError: a column is missing.
            ShapeError: a column has another shape.
            RunError: the batch has a frame of an excluded episode, or the loss of the step before is not finite.
        """
        if self.training:
            self._require_finite_loss()
            self._require_no_excluded(batch)
        sample = self._observation(batch, frames)
        sample[ACTION] = self._column(batch, ACTION, actions)
        for augment in self.symmetries if self.training else ():
            sample = augment(sample)
        return sample

    def _finished_updates(self) -> int:
        return self._updates

    def _require_finite_loss(self) -> None:
        loss, self._loss = self._loss, None
        if loss is None or bool(torch.isfinite(loss).all()):
            return
        raise NonFiniteLossError(float(loss[~torch.isfinite(loss)].flatten()[0]), self._finished_updates())

    def _require_no_excluded(self, batch: dict[str, Tensor]) -> None:
        if not len(self._excluded) or _EPISODE not in batch:
            return
        used = batch[_EPISODE][torch.isin(batch[_EPISODE], self._excluded.to(batch[_EPISODE].device))]
        if len(used):
            raise RunError(
                f"expected no excluded episode in a batch, found {sorted(set(used.tolist()))}; "
                "train with copolicy-train, which leaves them out, or give --dataset.episodes without them"
            )

    def _observation(self, batch: dict[str, Tensor], frames: int | None) -> dict[str, Tensor]:
        return {key: self._column(batch, key, frames) for key in self.config.observation_keys}

    def _column(self, batch: dict[str, Tensor], key: str, frames: int | None = None) -> Tensor:
        """A column of the batch, checked: `(B, frames, n)`, or `(B, n)` without frames.

        LeRobot drops the last axis of columns with one value per frame; it is restored.
        """
        if key not in batch:
            raise InvalidValueError("batch", f"the column {key}", sorted(batch))
        values, size = batch[key], self._sizes[key]
        expected = (size,) if frames is None else (frames, size)
        if size == 1 and values.ndim == len(expected):
            values = values[..., None]
        if values.ndim != 1 + len(expected) or tuple(values.shape[1:]) != expected:
            raise ShapeError(key, ("B", *expected), tuple(values.shape))
        return values
