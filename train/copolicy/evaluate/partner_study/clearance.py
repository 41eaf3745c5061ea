"""Distance between the moving body and the obstacles, from the outline of a task."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.task import PairTask

_CHUNK = 400  # poses at once, which bounds the memory


def smallest_distance(task: PairTask, scenario: Any, states: Array) -> float | None:
    """Smallest distance of the body to an obstacle over states `(T, n)`, in the unit of the outline.

    Body and obstacles are the convex polygons of `PairTask.outline`; 0 where they overlap.

    Returns:
        None if the task has no outline or the scenario no obstacle.
    """
    obstacles = _obstacles(task, scenario)
    if not obstacles:
        return None
    poses = task.required_outline.poses(states)
    bodies = [np.array(shape.corners) for shape in task.required_outline.body]
    reach = max(float(np.hypot(*body.T).max()) for body in bodies)
    nearest = np.inf
    for obstacle in obstacles:
        centre = obstacle.mean(axis=0)
        radius = float(np.hypot(*(obstacle - centre).T).max())
        apart = np.hypot(*(poses[:, :2] - centre).T)
        # A pose farther away than this cannot be the nearest one.
        close = poses[apart - reach - radius <= min(nearest, float(apart.min()))]
        nearest = min(nearest, float(_distances(bodies, obstacle, close).min(initial=np.inf)))
    return nearest


def distances(task: PairTask, scenario: Any, states: Array) -> Array | None:
    """`(T,)` distance of the body to the nearest obstacle in states `(T, n)`, as in `smallest_distance`."""
    obstacles = _obstacles(task, scenario)
    if not obstacles:
        return None
    poses = task.required_outline.poses(states)
    bodies = [np.array(shape.corners) for shape in task.required_outline.body]
    return np.min([_distances(bodies, obstacle, poses) for obstacle in obstacles], axis=0)


def _obstacles(task: PairTask, scenario: Any) -> list[Array]:
    shapes = () if task.outline is None else task.outline.fixed(scenario)
    return [np.array(shape.corners) for shape in shapes if shape.role == "obstacle"]


def _distances(bodies: Sequence[Array], obstacle: Array, poses: Array) -> Array:
    """`(T,)` distance of the nearest of the bodies at poses `(T, 3)` to an obstacle."""
    found = np.full(len(poses), np.inf)
    for first in range(0, len(poses), _CHUNK):
        part = poses[first : first + _CHUNK]
        for body in bodies:
            corners = placed(body, part)
            fixed = np.broadcast_to(obstacle, (len(part), *obstacle.shape))
            distance = np.minimum(_to_polygon(corners, fixed), _to_polygon(fixed, corners))
            np.minimum(found[first : first + _CHUNK], distance, out=found[first : first + _CHUNK])
    return found


def placed(body: Array, poses: Array) -> Array:
    """Scene coordinates `(T, p, 2)` of points of a body `(p, 2)` at poses `(T, 3)`, see `outline.to_scene`."""
    x, y, theta = poses.T[..., None]
    u, v = body.T
    cos, sin = np.cos(theta), np.sin(theta)
    return np.stack((x + u * cos + v * sin, y - u * sin + v * cos), axis=-1)


def _to_polygon(points: Array, polygons: Array) -> Array:
    """`(T,)` smallest distance of points `(T, p, 2)` to convex polygons `(T, q, 2)`; 0 if a point is inside."""
    starts = polygons[:, None]
    edges = np.roll(polygons, -1, axis=1)[:, None] - starts  # (T, 1, q, 2)
    offsets = points[:, :, None] - starts  # (T, p, q, 2)
    length = np.maximum((edges**2).sum(axis=-1), 1e-12)
    along = np.clip((offsets * edges).sum(axis=-1) / length, 0.0, 1.0)
    distance = np.linalg.norm(offsets - along[..., None] * edges, axis=-1).min(axis=-1)  # (T, p)
    sides = edges[..., 0] * offsets[..., 1] - edges[..., 1] * offsets[..., 0]
    inside = (sides >= 0).all(axis=-1) | (sides <= 0).all(axis=-1)
    return np.where(inside, 0.0, distance).min(axis=-1)
