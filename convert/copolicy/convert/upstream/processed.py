"""Imports `ep_N/ep_N.npz`, the output of the original's `process_data.py`.

Its rows hold the pose after each action in single precision, and no velocities, which the script overwrites. They are
computed from the actions, since an episode starts at rest and the dynamics are known, and verified by the positions.
Goal and obstacles come from a map file that may be another episode's (see `played_map`). Files written with the
script's options to skip, drop or smooth rows do not hold consecutive steps and are rejected.
"""

from pathlib import Path

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.episode import Episode
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.task_spec import RECORD_HZ
from copolicy.tasks.table.dynamics import step_linear, torque
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics

from .build_episode import Trajectory, UpstreamOptions, best_fit, build_episode
from .played_map import check_by_rewards, rounded
from .restricted_npz import load_npz

_FOLLOWS = 0.01  # px, rad; single precision alone gives 1e-4
_WIDTHS = {"states": 8, "actions": 4, "rewards": 1, "conditioning_var": 8}


def read_processed(path: Path, options: UpstreamOptions) -> Episode:
    """Reads one processed episode.

    Raises:
        FileFormatError: a damaged file, or one whose rows are not the consecutive steps of 1/30 s of an episode.
    """
    fields = _parse(path)
    actions = np.clip(fields["actions"], -1, 1)
    x, y, cosine, sine = fields["states"][:, :4].T
    next_poses = np.column_stack((x, y, np.unwrap(np.arctan2(sine, cosine))))
    trajectory = best_fit(lambda physics: _reconstruct(next_poses, actions, physics), options.angular_limit)
    if trajectory.residual > _FOLLOWS:
        raise FileFormatError(
            path,
            "consecutive steps of 1/30 s that follow from the actions",
            f"a step off by {trajectory.residual:.2g} px or rad (written with rows skipped, dropped or smoothed?)",
        )
    stored = _stored_map(fields, path, options.obstacle_size)
    finding = check_by_rewards(stored, trajectory.states[0], next_poses[:, :2], fields["rewards"][:, 0])
    origin = f"{path.parent.name}/{path.name}"
    content = path.read_bytes()
    return build_episode(trajectory, finding.config, content, RECORD_HZ, origin, finding.flags, finding.notes)


def _parse(path: Path) -> dict[str, Array]:
    fields = load_npz(path)
    missing = {*_WIDTHS, "table_init", "table_goal", "obstacles"} - set(fields)
    if missing:
        raise FileFormatError(path, f"the fields {', '.join(sorted(missing))}", f"only {', '.join(sorted(fields))}")
    try:
        fields = {name: fields[name].astype(float) for name in fields if name not in ("map_file", "terminal")}
    except (TypeError, ValueError) as error:
        raise FileFormatError(path, "arrays of numbers", str(error)) from None
    steps = len(np.atleast_1d(fields["actions"]))
    for name, width in _WIDTHS.items():
        if steps < 1 or fields[name].shape != (steps, width):
            raise FileFormatError(path, f"{name} of shape ({max(steps, 1)}, {width})", str(fields[name].shape))
        if not np.isfinite(fields[name]).all():
            raise FileFormatError(path, f"finite numbers in {name}", "nan or inf")
    return fields


def _stored_map(fields: dict[str, Array], path: Path, obstacle_size: int) -> MapConfig:
    try:
        x, y = fields["table_init"].reshape(2)
        (goal_x, goal_y), *obstacles = np.vstack((fields["table_goal"], fields["obstacles"].reshape(-1, 2)))
        config = MapConfig((x, y, fields["conditioning_var"][0, 2]), (goal_x, goal_y), tuple(obstacles), obstacle_size)
        return rounded(config)
    except (ValueError, InvalidValueError) as error:
        raise FileFormatError(path, "table_init, table_goal and obstacles as positions", str(error)) from None


def _reconstruct(next_poses: Array, actions: Array, physics: Physics) -> Trajectory:
    """Reconstructs the states from the poses `(T, 3)` after the actions, starting at rest."""
    dt, limit = physics.dt, physics.angular_acceleration_limit
    damping = physics.angular_damping / physics.inertia
    velocity = np.zeros((len(next_poses) + 1, 2))
    for step, action in enumerate(actions):
        _, velocity[step + 1] = step_linear(velocity[step], velocity[step], action, physics)
    # The torque is computed at the stored orientation, so that errors do not accumulate.
    first = next_poses[0, 2]
    for _ in range(20):
        alpha = np.clip(torque(first, actions[0], physics) / physics.inertia, -limit, limit)
        first = next_poses[0, 2] - alpha * dt * dt / 2
    accelerations = torque(np.append(first, next_poses[:-1, 2]), actions, physics) / physics.inertia
    spin = [0.0]
    for acceleration in accelerations.tolist():
        spin.append(spin[-1] + min(max(acceleration - damping * spin[-1], -limit), limit) * dt)
    omega = np.array(spin)
    displacement = (velocity[:-1] + velocity[1:]) * dt / 2
    rotation = (omega[:-1] + omega[1:]) * dt / 2
    poses = np.vstack(((*(next_poses[0, :2] - displacement[0]), first), next_poses))
    states = np.column_stack((poses[:, :2], poses[:, 2] % (2 * np.pi), velocity, omega))
    errors = np.column_stack((np.diff(poses[:, :2], axis=0) - displacement, np.diff(poses[:, 2]) - rotation))
    return Trajectory(states[:-1], actions, states[-1], physics, float(np.abs(errors).max()))
