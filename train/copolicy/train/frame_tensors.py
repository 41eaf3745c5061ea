"""All frames of a data set as tensors, and batches of windows gathered from them on any device."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import torch
from torch import Tensor

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import RunError


class FrameTensors:
    """The columns of N frames and the bounds of their episodes, as tensors on one device.

    A batch is gathered by a few index operations on that device, without copies from the host.
    """

    def __init__(
        self,
        columns: Mapping[str, Tensor | list[str]],
        bounds: tuple[Tensor, Tensor],
        delta_indices: Mapping[str, Sequence[int]],
    ):
        """
        Args:
            columns: `(N, n)` or `(N,)` tensors, or lists of N strings.
            bounds: two `(N,)` tensors, positions of the first and the last frame of each frame's episode.
            delta_indices: frames of a column's window, relative to the current frame.
        """
        self._columns = dict(columns)
        self._first, self._last = bounds
        # Columns with equal windows share the index tensors.
        self._deltas_of = {key: tuple(deltas) for key, deltas in delta_indices.items()}
        device = self._first.device
        self._offsets = {deltas: torch.tensor(deltas, device=device) for deltas in set(self._deltas_of.values())}

    @property
    def columns(self) -> Mapping[str, Tensor | list[str]]:
        """The columns of all frames, by name."""
        return self._columns

    @property
    def first(self) -> Tensor:
        """`(N,)` position of the first frame of each frame's episode."""
        return self._first

    def to(self, device: torch.device | str) -> "FrameTensors":
        """A copy on a device; strings stay on the host."""
        columns = {
            name: values.to(device) if isinstance(values, Tensor) else values for name, values in self._columns.items()
        }
        return FrameTensors(columns, (self._first.to(device), self._last.to(device)), self._deltas_of)

    def batch(self, rows: Tensor, indices: Sequence[int]) -> dict[str, Any]:
        """Gathers a batch of frames, with the keys in LeRobot's order.

        Args:
            rows: `(B,)` positions, on this object's device.
            indices: the same positions on the host, for strings.

        Returns:
            A column with a window is `(B, window, n)` and has a mask `KEY_is_pad` `(B, window)`, true where the window
            leaves the episode and repeats its first or last frame; any other column is `(B, n)`, or `(B,)` for n = 1.
        """
        windows = {deltas: self._window(rows, offsets) for deltas, offsets in self._offsets.items()}
        batch: dict[str, Any] = {}
        for key, values in self._columns.items():
            if not isinstance(values, Tensor):
                batch[key] = [values[index] for index in indices]
            else:
                batch[key] = values[windows[self._deltas_of[key]][0] if key in self._deltas_of else rows]
        for key, deltas in self._deltas_of.items():
            # A copy for each key, since tensors that LeRobot collates do not share memory either.
            batch[f"{key}_is_pad"] = windows[deltas][1].clone()
        return batch

    def _window(self, rows: Tensor, offsets: Tensor) -> tuple[Tensor, Tensor]:
        positions = rows[:, None] + offsets  # (B, window)
        first, last = self._first[rows, None], self._last[rows, None]
        return positions.clamp(first, last), (positions < first) | (positions > last)


def episode_bounds(index: Array, episode: Array, starts: Array, stops: Array, root: object) -> tuple[Tensor, Tensor]:
    """Positions of the first and the last frame of each frame's episode, `(N,)` each.

    Args:
        index: `(N,)` index of each frame in the whole data set.
        episode: `(N,)` episode of each frame.
        starts: index of the first frame of each episode of the whole data set.
        stops: index after the last frame of each episode.
        root: folder of the data set, for the error message.

    Raises:
        RunError: rows of an episode are missing or not in order.
    """
    broken = np.flatnonzero(episode >= len(starts))
    if not len(broken):
        position = np.arange(len(index))
        first = position - (index - starts[episode])
        last = position + (stops[episode] - 1 - index)
        inside = (first >= 0) & (last < len(index)) & (first <= position) & (position <= last)
        at_first, at_last = first.clip(0, len(index) - 1), last.clip(0, len(index) - 1)
        ordered = (index[at_first] == starts[episode]) & (index[at_last] == stops[episode] - 1)
        broken = np.flatnonzero(~(inside & ordered))
        if not len(broken):
            return torch.from_numpy(first), torch.from_numpy(last)
    raise RunError(
        f"{root}: expected the rows of each episode together and in order, as meta/episodes says, "
        f"found otherwise in episode {episode[broken[0]]}"
    )


def column_values(name: str, column: pa.ChunkedArray, shape: Sequence[int]) -> Tensor | list[str]:
    """Converts a column to the types of LeRobot's reader: float32, int64 or bool tensors, or a list of strings.

    Raises:
        RunError: the column has empty values.
    """
    array = column.combine_chunks()
    if isinstance(array, pa.ExtensionArray):
        array = array.storage
    if pa.types.is_string(array.type) or pa.types.is_large_string(array.type):
        return array.to_pylist()
    empty = array.null_count
    while pa.types.is_nested(array.type):
        array = array.flatten()
        empty += array.null_count
    if empty:
        raise RunError(f"{name}: expected a value in every row, found {empty} empty ones")
    values = array.to_numpy(zero_copy_only=False)
    if values.dtype.kind == "f":
        values = values.astype(np.float32)
    elif values.dtype.kind in "iu":
        values = values.astype(np.int64)
    return torch.from_numpy(values.reshape(len(column), *(() if tuple(shape) == (1,) else shape)).copy())
