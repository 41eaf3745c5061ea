"""The demonstrations of a data set: histories of frames, their actions and scenarios, and batches of encoded frames."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from copolicy.dataset.arrays import Array
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, STATE
from copolicy.dataset.task import PairTask

from ..memory_dataset import MemoryDataset

_CHUNK = 8192  # frames to encode at once, which bounds the memory

Augment = Callable[[dict[str, Tensor]], dict[str, Tensor]]


class Windows(NamedTuple):
    """Frames with their histories, in the task's units.

    Attributes:
        states: `(B, T, n)`, oldest first.
        scenarios: `(B, k)`.
        actions: `(B, 2 m)` joint actions.
    """

    states: Tensor
    scenarios: Tensor
    actions: Tensor


class Demonstrations:
    """All N frames of a data set.

    Attributes:
        task: of the data.
        episode: `(N,)` episode of each frame.
        starts: `(E,)` positions of the first frames of the episodes.
    """

    def __init__(
        self, dataset: MemoryDataset, task: PairTask, history: int, history_start: str, augmentations: Sequence[Augment]
    ):
        """
        Args:
            history: T, frames of a history.
            history_start: "zeros" or "first", see `CoGailConfig`.
            augmentations: symmetries that are applied to batches at random.
        """
        self.task = task
        columns = dataset.frames.columns
        self._states, self._scenarios, self._actions = (
            _matrix(columns[key]) for key in (STATE, ENVIRONMENT_STATE, ACTION)
        )
        self.episode = _matrix(columns["episode_index"])[:, 0]
        self._first = dataset.frames.first
        self.starts = torch.unique(self._first)
        self._offsets = torch.arange(1 - history, 1)
        self._zeros = history_start == "zeros"
        self._augmentations = list(augmentations)
        self._meta = dataset.meta
        self._columns = _scenario_columns(task, dataset.meta)

    def __len__(self) -> int:
        return len(self._states)

    @property
    def augmented(self) -> bool:
        """Whether equal rows give different windows."""
        return bool(self._augmentations)

    def windows(self, rows: Tensor) -> Windows:
        """The frames at positions `(B,)`, augmented at random by the symmetries."""
        positions = rows[:, None] + self._offsets
        first = self._first[rows, None]
        batch = {
            STATE: self._states[positions.clamp(min=first)],
            ENVIRONMENT_STATE: self._scenarios[rows, None],
            ACTION: self._actions[rows, None],
        }
        for augment in self._augmentations:
            batch = augment(batch)
        if self._zeros:
            batch[STATE] = torch.where((positions < first)[..., None], 0.0, batch[STATE])
        return Windows(batch[STATE], batch[ENVIRONMENT_STATE][:, 0], batch[ACTION][:, 0])

    def scenario_columns(self, row: int) -> Mapping[str, Any]:
        """The episode columns that complete the scenario vector of a frame."""
        return self._columns[int(self.episode[row])]


class EncodedFrames:
    """Batches of encoded demonstrated frames: inputs of the networks, and joint actions scaled to [-1, 1].

    Frames without augmentation are encoded once.
    """

    def __init__(self, demonstrations: Demonstrations, inputs: nn.Module, scaled: Callable[[Tensor], Tensor]):
        self._demonstrations, self._inputs, self._scaled = demonstrations, inputs, scaled
        self._all = None if demonstrations.augmented else self._encoded(torch.arange(len(demonstrations)))

    def __len__(self) -> int:
        return len(self._demonstrations)

    def sample(self, count: int) -> tuple[Array, Array]:
        """Inputs `(count, size)` and actions `(count, 2 m)` of frames drawn with replacement."""
        rows = torch.randint(len(self), (count,))
        if self._all is None:
            return self._encoded(rows)
        inputs, actions = self._all
        return inputs[rows.numpy()], actions[rows.numpy()]

    @torch.no_grad()
    def _encoded(self, rows: Tensor) -> tuple[Array, Array]:
        inputs, actions = [], []
        for chunk in rows.split(_CHUNK):
            windows = self._demonstrations.windows(chunk)
            inputs.append(self._inputs(windows.states, windows.scenarios))
            actions.append(self._scaled(windows.actions))
        return torch.cat(inputs).numpy(), torch.cat(actions).numpy()


def _matrix(column: Tensor | list[str]) -> Tensor:
    """A column as `(N, n)`; LeRobot stores columns with one value per frame as `(N,)`."""
    assert isinstance(column, Tensor), "a column of numbers"
    return column[:, None] if column.ndim == 1 else column


def _scenario_columns(task: PairTask, meta: Any) -> dict[int, dict[str, Any]]:
    """By episode, the columns with the information that a scenario vector lacks, as far as the data set has them."""
    scenario = next((scenarios[0] for scenarios in task.scenario_sets.values() if scenarios), None)
    wanted = {"map_id", *(task.columns_of(scenario) if scenario is not None else ())}
    names = [name for name in meta.episodes.column_names if name in wanted]
    rows = zip(*(meta.episodes[name] for name in names), strict=True) if names else ((),) * meta.total_episodes
    episodes = meta.episodes["episode_index"]
    return {int(episode): dict(zip(names, row, strict=True)) for episode, row in zip(episodes, rows, strict=True)}
