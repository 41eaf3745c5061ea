"""Imports `trajectories/ep_N.pkl`, the recordings of the original program.

A row holds the state after its action, so the states before the actions are the rows shifted by one. The state before
the first action is the map file's start if the dynamics lead from it to the first row, else the inverse of the first
step. Goal and obstacles are those of the rows, not of the map file. The program does not save time-outs, only
episodes that end by success or collision.
"""

from pathlib import Path

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.episode import Episode
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.file_kinds import describe_path
from copolicy.dataset.task_spec import RECORD_HZ
from copolicy.tasks.table.dynamics import step_angular, step_linear, undo_angular, undo_linear
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics

from .build_episode import Trajectory, UpstreamOptions, best_fit, build_episode, start_pose
from .played_map import start_differs
from .restricted_npz import load_npz
from .restricted_pickle import load_pickle

_FIXED_FIELDS = 19  # fields of a row without obstacles; each obstacle adds one field of two numbers
_EXACT = 1e-6  # px, rad: raw files are in double precision
_FOLLOWS = 1e-3


def read_raw(path: Path, options: UpstreamOptions) -> Episode:
    """Reads one `ep_N.pkl`, with `../map_cfg/ep_N.npz` and `../fluency/ep_N.npz` if they exist.

    Raises:
        FileFormatError: a damaged file, or not a file of the original program.
    """
    if not path.is_file():
        raise FileFormatError(path, "a pickle of NumPy arrays and plain values", describe_path(path))
    content = path.read_bytes()
    rows = load_pickle(content, path)
    next_states, actions, goal, obstacles, recorded_success = _parse(rows, path)
    notes: tuple[str, ...] = ()
    file_map = _map_file(path.parent.parent / "map_cfg" / f"{path.stem}.npz", options.obstacle_size)
    start = file_map.start if file_map else None
    trajectory = best_fit(lambda physics: _shift(next_states, actions, start, physics), options.angular_limit)
    first = trajectory.states[0]
    begins = start if start is not None and np.allclose(first[:3], start, rtol=0, atol=_EXACT) else start_pose(first)
    config = MapConfig(begins, goal, obstacles, options.obstacle_size)
    flags: tuple[str, ...] = ()
    if file_map is None:
        notes += ("no map file of this name: start computed by inverting the first step",)
    elif difference := _difference(file_map, config, first):
        flags += ("map_mismatch", "map_recovered")
        notes += (f"map file is not the one played: {difference}; start, goal and obstacles are those of the rows",)
    if trajectory.residual > _FOLLOWS:
        flags += ("dynamics_mismatch",)
        notes += (f"a step differs from the dynamics by {trajectory.residual:.2g} px or rad",)
    notes += _fluency_note(path.parent.parent / "fluency" / f"{path.stem}.npz", len(actions))
    origin = f"{path.parent.name}/{path.name}"
    return build_episode(trajectory, config, content, RECORD_HZ, origin, flags, notes, recorded_success)


def _parse(rows: object, path: Path):
    """States after the actions `(T, 6)`, clipped actions `(T, 4)`, goal, obstacles and success flag of the last row."""
    if not isinstance(rows, list) or not rows or not all(isinstance(row, list) for row in rows):
        raise FileFormatError(path, "a list of rows, each a list", type(rows).__name__)
    width = len(rows[0])
    if width < _FIXED_FIELDS or any(len(row) != width for row in rows):
        raise FileFormatError(path, f"rows of one length of at least {_FIXED_FIELDS}", f"{width} fields in the first")
    try:
        next_states = np.array([row[:6] for row in rows], dtype=float)
        actions = np.array([np.ravel(row[6]) for row in rows], dtype=float)
        settings = np.array([np.concatenate([np.ravel(part) for part in row[12 : width - 6]]) for row in rows], float)
        steps = np.array([row[10] for row in rows], dtype=int)
        periods = np.array([row[11] for row in rows], dtype=float)
        success = bool(rows[-1][9])
    except (TypeError, ValueError, OverflowError) as error:
        raise FileFormatError(path, "rows of numbers as the original program writes them", str(error)) from None
    if actions.shape != (len(rows), 4) or settings.shape != (len(rows), 2 + 2 * (width - _FIXED_FIELDS)):
        raise FileFormatError(
            path, "four forces, a goal and obstacles in each row", f"{actions.shape}, {settings.shape}"
        )
    if not (np.isfinite(next_states).all() and np.isfinite(actions).all() and np.isfinite(settings).all()):
        raise FileFormatError(path, "finite numbers", "nan or inf")
    if (steps != np.arange(1, len(rows) + 1)).any():
        raise FileFormatError(path, f"steps numbered 1 to {len(rows)}", f"{steps[0]} to {steps[-1]}")
    if not np.allclose(periods, 1 / RECORD_HZ):
        raise FileFormatError(path, f"steps of 1/{RECORD_HZ} s", f"{periods.min():.4g} to {periods.max():.4g} s")
    if (settings != settings[0]).any():
        raise FileFormatError(path, "one goal and one set of obstacles", "rows that differ in them")
    pairs = [(float(x), float(y)) for x, y in settings[0].reshape(-1, 2)]
    return next_states, np.clip(actions, -1, 1), pairs[0], tuple(pairs[1:]), success


def _map_file(path: Path, obstacle_size: int) -> MapConfig | None:
    if not path.is_file():
        return None
    fields = load_npz(path)
    try:
        table, goal = fields["table"].item(), fields["goal"].item()["goal"]
        obstacles = np.asarray(fields["obstacles"].item()["obstacles"], dtype=float).reshape(-1, 2)
        start = (float(table["x"]), float(table["y"]), float(table["angle"]))
        return MapConfig(start, (float(goal[0]), float(goal[1])), tuple(map(tuple, obstacles)), obstacle_size)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise FileFormatError(path, "a map file with table, goal and obstacles", repr(error)) from None


def _shift(next_states: Array, actions: Array, start: tuple | None, physics: Physics) -> Trajectory:
    first = _state_before(next_states[0], actions[0], physics)
    if start is not None:
        start_state = np.array((*start, 0.0, 0.0, 0.0))
        if _step_error(start_state[None], actions[:1], next_states[:1], physics) <= _EXACT:
            first = start_state
    states = np.vstack((first, next_states[:-1]))
    return Trajectory(states, actions, next_states[-1], physics, _step_error(states, actions, next_states, physics))


def _state_before(next_state: Array, action: Array, physics: Physics) -> Array:
    """The state `(6,)` before the first row; of the possible spins the slowest, since an episode starts at rest."""
    position, velocity = undo_linear(next_state[:2], next_state[3:5], action, physics)
    angles, spins = undo_angular(next_state[2], next_state[5], action, physics)
    slowest = int(np.nan_to_num(np.abs(spins), nan=np.inf).argmin())
    return np.array((*position, angles[slowest] % (2 * np.pi), *velocity, spins[slowest]))


def _step_error(states: Array, actions: Array, next_states: Array, physics: Physics) -> float:
    position, velocity = step_linear(states[:, :2], states[:, 3:5], actions, physics)
    theta, omega = step_angular(states[:, 2], states[:, 5], actions, physics)
    turn = (theta - next_states[:, 2] + np.pi) % (2 * np.pi) - np.pi
    differences = (position - next_states[:, :2], velocity - next_states[:, 3:5], turn, omega - next_states[:, 5])
    return max(float(np.abs(difference).max()) for difference in differences)


def _difference(file_map: MapConfig, config: MapConfig, first: Array) -> str:
    if file_map.goal != config.goal:
        return f"its goal is {file_map.goal}"
    if file_map.obstacles != config.obstacles:
        return f"its obstacles are {file_map.obstacles}"
    return start_differs(file_map, first)


def _fluency_note(path: Path, steps: int) -> tuple[str, ...]:
    """A note if the length of the fluency file differs; its values follow from the rows."""
    if not path.is_file():
        return ()
    lengths = {len(np.atleast_1d(values)) for values in load_npz(path).values()}
    return () if lengths == {steps} else (f"fluency file has {sorted(lengths)} steps for {steps} rows",)
