"""The table's `TaskSpec`: names, units and bounds of its vectors."""

import math

from copolicy.dataset.task_spec import TaskSpec, Vector

from .map_config import MAX_OBSTACLES, WINDOW

_WIDTH, _HEIGHT = (float(side) for side in WINDOW)
_TURN = 2 * math.pi
SPEED, _SPIN = 50.0, math.pi / 2  # px/s, the terminal speed of an axis under two full forces; rad/s

_VELOCITY = (("vx", "px/s", -SPEED, SPEED), ("vy", "px/s", -SPEED, SPEED), ("omega", "rad/s", -_SPIN, _SPIN))
_POSITION = (("x", "px", 0.0, _WIDTH), ("y", "px", 0.0, _HEIGHT))


def _vector(*entries: tuple[str, str, float, float]) -> Vector:
    return Vector(*zip(*entries, strict=True))


SPEC = TaskSpec(
    name="table",
    title="table carrying",
    sentence="Carry the table to the goal together.",
    state=_vector(*_POSITION, ("cos_theta", "1", -1.0, 1.0), ("sin_theta", "1", -1.0, 1.0), *_VELOCITY),
    recorded=_vector(*_POSITION, ("theta", "rad", 0.0, _TURN), *_VELOCITY),
    scenario=_vector(
        ("start_x", "px", 0.0, _WIDTH),
        ("start_y", "px", 0.0, _HEIGHT),
        ("start_theta", "rad", 0.0, _TURN),
        ("goal_x", "px", 0.0, _WIDTH),
        ("goal_y", "px", 0.0, _HEIGHT),
        *(
            (f"obstacle_{slot}_{axis}", "px", 0.0, side)
            for slot in range(MAX_OBSTACLES)
            for axis, side in (("x", _WIDTH), ("y", _HEIGHT))
        ),
    ),
    action=_vector(("fx", "a player's full force", -1.0, 1.0), ("fy", "a player's full force", -1.0, 1.0)),
    reasons=("goal", "collision_obstacle", "collision_wall", "timeout"),
)
