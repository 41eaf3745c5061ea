"""The step of the world on arrays, forward and backward, for files that do not store every state.

A step from (q, v) with acceleration a goes to q + v dt + a dt^2 / 2 and v + a dt; with both velocities known that
is q + (v + v') dt / 2. Linear: a = (50 sum u - b v) / m. Angular: alpha = clip((M(theta) - d omega) / I, -c, c)
with the torque M. The equations are those of the original program; tests compare them with `TableWorld`.
"""

import math

import numpy as np

from copolicy.dataset.arrays import Array

from .physics import Physics

_FIXED_POINT_STEPS = 20  # the iteration contracts by at least 8 a step


def torque(theta: Array, actions: Array, physics: Physics) -> Array:
    """Torque of both players `(...)` at orientations `(...)` under actions `(..., 4)`."""
    difference = physics.force_scale * (actions[..., 2:] - actions[..., :2])
    return physics.lever / 2 * (np.sin(theta) * difference[..., 0] + np.cos(theta) * difference[..., 1])


def step_angular(theta: Array, omega: Array, actions: Array, physics: Physics) -> tuple[Array, Array]:
    """Orientation (not wrapped) and angular velocity after one step, `(...)` each."""
    limit = physics.angular_acceleration_limit
    alpha = (torque(theta, actions, physics) - physics.angular_damping * omega) / physics.inertia
    after = omega + np.clip(alpha, -limit, limit) * physics.dt
    return theta + (omega + after) * physics.dt / 2, after


def step_linear(position: Array, velocity: Array, actions: Array, physics: Physics) -> tuple[Array, Array]:
    """Position and velocity `(..., 2)` after one step."""
    acceleration = _push(actions, physics) - physics.linear_damping / physics.mass * velocity
    after = velocity + acceleration * physics.dt
    return position + (velocity + after) * physics.dt / 2, after


def undo_linear(position: Array, velocity: Array, actions: Array, physics: Physics) -> tuple[Array, Array]:
    """Position and velocity `(..., 2)` before the step that ended in these; exact."""
    before = (velocity - _push(actions, physics) * physics.dt) / (
        1 - physics.linear_damping / physics.mass * physics.dt
    )
    return position - (before + velocity) * physics.dt / 2, before


def undo_angular(theta: Array, omega: Array, actions: Array, physics: Physics) -> tuple[Array, Array]:
    """All orientations and angular velocities before a step that could have ended in these.

    Without the clip, damping multiplies omega by 1 - 40/30 < 0, so that up to three predecessors exist.

    Returns:
        Two arrays `(3, ...)`: not clipped, clipped above, clipped below; NaN where that is no predecessor.
    """
    dt, limit = physics.dt, physics.angular_acceleration_limit
    damping = physics.angular_damping / physics.inertia
    free = np.array(omega, dtype=float)
    for _ in range(_FIXED_POINT_STEPS):  # the torque depends on the unknown orientation
        push = torque(theta - (free + omega) * dt / 2, actions, physics) / physics.inertia
        free = (omega - push * dt) / (1 - damping * dt)
    before = np.stack((free, omega - limit * dt, omega + limit * dt))
    angles = theta - (before + omega) * dt / 2
    _, after = step_angular(angles, before, actions, physics)
    impossible = np.abs(after - omega) > 1e-9
    return np.where(impossible, np.nan, angles), np.where(impossible, np.nan, before)


def integrate(
    pose: tuple[float, float, float], velocity: tuple[float, float, float], actions: Array, physics: Physics
) -> Array:
    """`(T + 1, 6)` x, y, theta (not wrapped), vx, vy, omega under actions `(T, 4)`."""
    dt, limit = physics.dt, physics.angular_acceleration_limit
    arm = physics.lever / 2 * physics.force_scale / physics.inertia
    spin_damping, damping = physics.angular_damping / physics.inertia, physics.linear_damping / physics.mass
    pushes = _push(actions, physics).tolist()
    twists = (arm * (actions[:, 2:] - actions[:, :2])).tolist()
    x, y, theta, vx, vy, omega = (float(value) for value in (*pose, *velocity))
    states = [(x, y, theta, vx, vy, omega)]
    half = dt * dt / 2
    # Python floats, since one array operation takes longer than a whole step.
    for (push_x, push_y), (twist_x, twist_y) in zip(pushes, twists, strict=True):
        ax, ay = push_x - damping * vx, push_y - damping * vy
        alpha = math.sin(theta) * twist_x + math.cos(theta) * twist_y - spin_damping * omega
        alpha = min(max(alpha, -limit), limit)
        x, y, theta = x + vx * dt + ax * half, y + vy * dt + ay * half, theta + omega * dt + alpha * half
        vx, vy, omega = vx + ax * dt, vy + ay * dt, omega + alpha * dt
        states.append((x, y, theta, vx, vy, omega))
    return np.array(states)


def _push(actions: Array, physics: Physics) -> Array:
    return physics.force_scale / physics.mass * (actions[..., :2] + actions[..., 2:])
