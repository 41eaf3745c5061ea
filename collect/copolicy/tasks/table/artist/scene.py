"""The scene for Foxglove: table, players, forces, obstacles and goal as `foxglove.SceneUpdate`.

Scene units are metres, 1 px = 0.01 m, and y points up: (x, y) px is at (0.01 x, 0.01 (600 - y)) m.
Angles are the same, since theta is counter-clockwise on screen.
"""

import math
from typing import Any

from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from copolicy.dataset.outline import to_scene
from copolicy.dataset.recording.topics import Topic
from copolicy.dataset.task_spec import PLAYERS

from ..geometry import BOARD, CIRCLE_CENTRE, CIRCLE_RADIUS, TRIANGLE
from ..map_config import WINDOW, MapConfig
from ..physics import GOAL_SIZE

FRAME_DESCRIPTION = "world: x right, y up, z out of the screen; 1 px = 0.01 m"
SCENE_MAP = Topic("/scene/map", SceneUpdate, {"units": "m", "frame": FRAME_DESCRIPTION})
SCENE = Topic("/scene", SceneUpdate, {"units": "m", "frame": FRAME_DESCRIPTION})

FRAME = "world"
METRES_PER_PIXEL = 0.01

HEIGHT = 0.2  # m, of all solids
_FORCE_LENGTH = 1.0  # m, shaft of a player's full force
_HEAD_LENGTH = 0.15  # m, head of its arrow
BOARD_CENTRE = ((BOARD[0] + BOARD[2]) / 2, (BOARD[1] + BOARD[3]) / 2)
# Origin of a player's force: the centre of the triangle and of the circle, image coordinates in px.
_SEATS = ((75.5, 6.0), CIRCLE_CENTRE)
COLOURS = {
    "table": Color(r=0.55, g=0.40, b=0.25, a=1.0),
    "robot": Color(r=0.20, g=0.40, b=0.85, a=1.0),
    "human": Color(r=0.95, g=0.55, b=0.15, a=1.0),
    "goal": Color(r=0.25, g=0.70, b=0.35, a=0.6),
    "obstacle": Color(r=0.75, g=0.20, b=0.20, a=1.0),
    "window": Color(r=0.50, g=0.50, b=0.50, a=1.0),
}

Pose = tuple[float, float, float]


def map_scene(map_config: MapConfig, time_ns: int) -> bytes:
    """The fixed parts: goal, obstacles and border of the window, as a serialised SceneUpdate.

    They have their own topic, written once, since a viewer that seeks shows the last message of each topic.
    """
    update = SceneUpdate()
    squares = [("goal", "goal", map_config.goal, GOAL_SIZE)]
    for index, (centre, size) in enumerate(map_config.squares):
        squares.append((f"obstacle_{index}", "obstacle", centre, size))
    for name, colour, centre, size in squares:
        cube = _entity(update, name, time_ns).cubes.add(color=COLOURS[colour])
        _set_position(cube.pose, *metres(centre), z=HEIGHT / 2)
        cube.pose.orientation.w = 1.0
        _size(cube.size, size, size)
    border = _entity(update, "window", time_ns).lines.add(
        type=LinePrimitive.LINE_LOOP, thickness=0.02, color=COLOURS["window"]
    )
    border.pose.orientation.w = 1.0
    for corner in ((0, 0), (WINDOW[0], 0), WINDOW, (0, WINDOW[1])):
        x, y = metres(corner)
        border.points.append(Point3(x=x, y=y, z=0.0))
    return update.SerializeToString()


class TableScene:
    """The moving parts: the table's board, its two ends, and the forces of the players.

    The message is built once and only its poses and lengths change from step to step, which takes less than half the
    time of building it.
    """

    def __init__(self):
        self._update = update = SceneUpdate()
        entities = [_entity(update, name, 0) for name in ("table", *PLAYERS)]
        self._timestamps = [entity.timestamp for entity in entities]
        table, robot, human = entities

        board = table.cubes.add(color=COLOURS["table"])
        _size(board.size, BOARD[2] - BOARD[0], BOARD[3] - BOARD[1])
        circle = human.cylinders.add(color=COLOURS["human"], bottom_scale=1.0, top_scale=1.0)
        _size(circle.size, 2 * CIRCLE_RADIUS, 2 * CIRCLE_RADIUS)
        triangle = robot.triangles.add(color=COLOURS["robot"])
        for u, v in reversed(TRIANGLE):  # counter-clockwise from above once v points up
            triangle.points.append(Point3(x=u * METRES_PER_PIXEL, y=-v * METRES_PER_PIXEL, z=0.0))
        triangle.indices.extend((0, 1, 2, 0, 2, 3))
        # The triangle's points are relative to the centre of the table, the other parts to their own centres.
        self._parts = (
            (board.pose, BOARD_CENTRE, HEIGHT / 2),
            (circle.pose, CIRCLE_CENTRE, HEIGHT / 2),
            (triangle.pose, (0.0, 0.0), HEIGHT),
        )
        self._arrows = tuple(
            entity.arrows.add(color=COLOURS[name], shaft_diameter=0.06, head_diameter=0.14)
            for entity, name in zip((robot, human), PLAYERS, strict=True)
        )

    def update(self, time_ns: int, pose: Pose, action: tuple[float, ...]) -> bytes:
        """The serialised SceneUpdate of a pose (px, px, rad) and the forces that act in it (robot xy, human xy)."""
        seconds, nanos = divmod(time_ns, 10**9)
        for timestamp in self._timestamps:
            timestamp.seconds, timestamp.nanos = seconds, nanos
        z, w = quaternion_zw(pose[2])
        for part, point, height in self._parts:
            _set_position(part, *_to_scene(pose, point), height)
            part.orientation.z, part.orientation.w = z, w
        for player, arrow in enumerate(self._arrows):
            fx, fy = action[2 * player], -action[2 * player + 1]
            strength, yaw = math.hypot(fx, fy), math.atan2(fy, fx)
            _set_position(arrow.pose, *_to_scene(pose, _SEATS[player]), HEIGHT)
            arrow.pose.orientation.z, arrow.pose.orientation.w = quaternion_zw(yaw)
            arrow.shaft_length = rounded(_FORCE_LENGTH * strength)
            arrow.head_length = rounded(_HEAD_LENGTH * strength)
        return self._update.SerializeToString()


def _entity(update: Any, name: str, time_ns: int) -> Any:
    entity = update.entities.add(id=name, frame_id=FRAME)
    entity.timestamp.seconds, entity.timestamp.nanos = divmod(time_ns, 10**9)
    return entity


def metres(point: tuple[float, float]) -> tuple[float, float]:
    """Scene coordinates, m, of a point on screen, px."""
    return METRES_PER_PIXEL * point[0], METRES_PER_PIXEL * (WINDOW[1] - point[1])


def _to_scene(pose: Pose, point: tuple[float, float]) -> tuple[float, float]:
    """Scene coordinates, m, of a point (u, v) of the table at a pose, px."""
    x, y = metres(to_scene(pose, point))
    return rounded(x), rounded(y)


def quaternion_zw(yaw: float) -> tuple[float, float]:
    """z and w of the quaternion that turns by `yaw` (rad)."""
    return rounded(math.sin(yaw / 2)), rounded(math.cos(yaw / 2))


def rounded(value: float) -> float:
    """Rounded to 1/4096, a fortieth of a pixel, so that messages compress well."""
    return round(value * 4096) / 4096


def _set_position(pose: Any, x: float, y: float, z: float) -> None:
    position = pose.position
    position.x, position.y, position.z = x, y, z


def _size(size: Any, width: float, depth: float) -> None:
    size.x, size.y, size.z = METRES_PER_PIXEL * width, METRES_PER_PIXEL * depth, HEIGHT
