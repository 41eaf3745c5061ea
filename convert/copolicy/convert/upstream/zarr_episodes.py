"""Imports the 10 Hz Zarr store of the original's `process_data_zarr.py`, the form of the released data.

Row i of an episode (k = 3 i) holds the state after action u_k, that action, and the action before it at 30 Hz; the two
actions in between are not stored. The state in which u_k was taken is computed by inverting the step. The inverse of
the rotation has up to three solutions; the one is used whose own inverse, with the stored previous action, follows the
previous row. The store does not hold the motion at 30 Hz, actions averaged over a frame (it holds the first of three),
up to two steps at the end, or success, which is recomputed.
"""

from pathlib import Path

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.episode import Episode
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.tasks.table.dynamics import step_angular, step_linear, undo_angular, undo_linear
from copolicy.tasks.table.features import map_from_vector, theta_of
from copolicy.tasks.table.physics import Physics

from .build_episode import Trajectory, UpstreamOptions, best_fit, build_episode, states_7
from .played_map import check_by_path, rounded
from .zarr_arrays import ZarrArrays

ZARR_HZ = 10
"""Rows per second of the store."""

OBSERVATIONS = "data/obs"
"""The array that identifies a store of this kind."""

_FOLLOWS = 1e-3  # px, rad


class ZarrStore:
    """The arrays of a store, divided into episodes.

    Raises:
        FileFormatError: not a store of this kind, or the shapes of its arrays contradict each other.
    """

    def __init__(self, path: Path):
        self.path = path
        arrays = ZarrArrays(path, OBSERVATIONS)
        obs, self.actions, self.past = (
            arrays.read(name).astype(float) for name in (OBSERVATIONS, "data/action", "data/past_action")
        )
        ends = _whole_numbers(arrays.read("meta/episode_ends"), path)
        rows = len(np.atleast_1d(obs))
        if obs.ndim != 2 or obs.shape[1] not in (18, 19):
            raise FileFormatError(path / "data" / "obs", "18 columns, or 19 with a reward", f"shape {obs.shape}")
        for name, array in (("action", self.actions), ("past_action", self.past)):
            if array.shape != (rows, 4):
                raise FileFormatError(path / "data" / name, f"shape ({rows}, 4)", f"{array.shape}")
        if not len(ends) or (np.diff(ends, prepend=0) < 1).any() or ends[-1] != rows:
            raise FileFormatError(path / "meta" / "episode_ends", f"row ends growing up to {rows}", f"{ends[-3:]}")
        self.obs = obs[:, :18]
        self.ends = ends

    def __len__(self) -> int:
        return len(self.ends)

    def read(self, index: int, options: UpstreamOptions) -> Episode:
        """Reads one episode at 10 Hz.

        Raises:
            FileFormatError: its rows are not finite or hold no valid map.
        """
        rows = slice(self.ends[index - 1] if index else 0, self.ends[index])
        obs, actions, past = self.obs[rows], self.actions[rows], self.past[rows]
        if not (np.isfinite(obs).all() and np.isfinite(actions).all() and np.isfinite(past).all()):
            raise FileFormatError(f"{self.path} (episode {index})", "finite numbers", "nan or inf")
        # A chunk of an array that is not stored reads as zeros.
        if (np.abs(np.hypot(obs[:, 2], obs[:, 3]) - 1) > _FOLLOWS).any():
            raise FileFormatError(
                f"{self.path} (episode {index})", "cosine and sine of an angle in columns 2 and 3", "other values"
            )
        content = np.column_stack((obs, actions, past)).astype("<f8").tobytes()
        actions, past = np.clip(actions, -1, 1), np.clip(past, -1, 1)
        trajectory = best_fit(lambda physics: _states_before(obs, actions, past, physics), options.angular_limit)
        try:
            stored = rounded(map_from_vector(obs[0, 7:18], options.obstacle_size))
        except InvalidValueError as error:
            raise FileFormatError(f"{self.path} (episode {index})", "a map", str(error)) from None
        finding = check_by_path(
            stored,
            states_7(trajectory.states),
            states_7(trajectory.final_state),
            actions[-1],
            trajectory.physics,
        )
        flags, notes = finding.flags, finding.notes
        if trajectory.residual > _FOLLOWS:
            flags += ("dynamics_mismatch",)
            notes += (f"a row differs from the dynamics by {trajectory.residual:.2g} px or rad",)
        origin = f"{self.path.name}, episode {index}"
        return build_episode(trajectory, finding.config, content, ZARR_HZ, origin, flags, notes)


def advance_one_step(states: Array, actions: Array, physics: Physics) -> Array:
    """States `(T, 7)` after one step of 1/30 s with `actions` from `states`, as in the rows of a store."""
    position, velocity = step_linear(states[:, :2], states[:, 4:6], actions, physics)
    theta, omega = step_angular(theta_of(states), states[:, 6], actions, physics)
    return states_7(np.column_stack((position, theta, velocity, omega)))


def _whole_numbers(ends: Array, path: Path) -> Array:
    if ends.dtype.kind == "f" and not (np.abs(ends) < 1 << 53).all():
        raise FileFormatError(path / "meta" / "episode_ends", "row numbers", "other values")
    return ends.astype(int).ravel()


def _states_before(obs: Array, actions: Array, past: Array, physics: Physics) -> Trajectory:
    """Computes the states before each row's action from the rows `(T, 18)` after it."""
    theta, omega = np.arctan2(obs[:, 3], obs[:, 2]), obs[:, 6]
    position, velocity = undo_linear(obs[:, :2], obs[:, 4:6], actions, physics)
    angles, spins = undo_angular(theta, omega, actions, physics)  # (3, T)
    errors = np.empty(angles.shape)
    errors[:, 0] = np.abs(spins[:, 0])  # an episode starts at rest
    # Inverted once more, to s_{k-1}, a candidate must be one step, with any torque, after s_{k-2} of the previous row.
    earlier, earlier_spins = undo_angular(angles[:, 1:], spins[:, 1:], past[1:], physics)  # (3, 3, T - 1)
    arc = earlier - theta[:-1] - (earlier_spins + omega[:-1]) * physics.dt / 2
    arc = np.abs((arc + np.pi) % (2 * np.pi) - np.pi)
    too_fast = np.abs(earlier_spins - omega[:-1]) > physics.angular_acceleration_limit * physics.dt + 1e-6
    # If no candidate follows, for example because the stored previous action is wrong, any existing one is used.
    arc = np.where(np.isnan(arc) | too_fast, np.pi, arc)
    errors[:, 1:] = arc.min(axis=0)
    errors = np.where(np.isnan(angles), np.inf, errors)
    chosen = errors.argmin(axis=0)
    column = np.arange(len(obs))
    states = np.column_stack((position, angles[chosen, column] % (2 * np.pi), velocity, spins[chosen, column]))
    earlier_position, earlier_velocity = undo_linear(position[1:], velocity[1:], past[1:], physics)
    gap = earlier_position - obs[:-1, :2] - (earlier_velocity + obs[:-1, 4:6]) * physics.dt / 2
    residual = max(float(errors.min(axis=0).max()), float(np.abs(gap).max(initial=0.0)))
    final_state = np.array((*obs[-1, :2], theta[-1] % (2 * np.pi), *obs[-1, 4:7]))
    return Trajectory(states, actions, final_state, physics, residual)
