"""The same scene for viewers that do not support SceneUpdate, such as Rerun: boxes as VoxelGrid, the table as a frame.

A box is a `foxglove.VoxelGrid` of one cell, written once: goal and obstacles in the frame `world`, the table and its
two ends in the frame `table`. A `foxglove.FrameTransform` from `world` to `table` is written each step.
Units and axes are those of `scene`.
"""

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.VoxelGrid_pb2 import VoxelGrid

from copolicy.dataset.recording.topics import Record, Topic
from copolicy.dataset.task_spec import PLAYERS

from ..geometry import BOARD, CIRCLE_CENTRE, CIRCLE_RADIUS, TRIANGLE
from ..map_config import MAX_OBSTACLES, MapConfig
from ..physics import GOAL_SIZE
from .scene import (
    BOARD_CENTRE,
    COLOURS,
    FRAME,
    FRAME_DESCRIPTION,
    HEIGHT,
    METRES_PER_PIXEL,
    Pose,
    metres,
    quaternion_zw,
    rounded,
)

TABLE_FRAME_ID = "table"

TABLE_FRAME = Topic("/scene/transform", FrameTransform, {"units": "m", "frame": FRAME_DESCRIPTION})
MAP_SOLIDS = tuple(
    Topic(f"/scene/solid/{name}", VoxelGrid, {"units": "m", "frame": FRAME_DESCRIPTION})
    for name in ("goal", *(f"obstacle_{slot}" for slot in range(MAX_OBSTACLES)))
)
TABLE_SOLIDS = tuple(
    Topic(f"/scene/solid/{name}", VoxelGrid, {"units": "m", "frame": "table: origin in its middle, turns with it"})
    for name in ("table", *PLAYERS)
)

_INSET = 0.002  # m, inside the solids of the SceneUpdate, so that a viewer that draws both does not flicker
_CHANNELS = ("red", "green", "blue", "alpha")
# Left, top, right, bottom, px.
_TRIANGLE_BOX = tuple(choose(point[axis] for point in TRIANGLE) for choose in (min, max) for axis in (0, 1))


def solid_records(map_config: MapConfig, time_ns: int) -> list[Record]:
    """Goal, obstacles, table and both ends as serialised VoxelGrids with their topics."""
    squares = [(map_config.goal, GOAL_SIZE, "goal")]
    squares += [(centre, size, "obstacle") for centre, size in map_config.squares]
    records = [
        (topic, _box(FRAME, metres(centre), (size, size), colour, time_ns))
        for topic, (centre, size, colour) in zip(MAP_SOLIDS, squares, strict=False)
    ]
    left, top, right, bottom = BOARD
    u0, v0, u1, v1 = _TRIANGLE_BOX
    parts = (
        (BOARD_CENTRE, (right - left, bottom - top)),
        (((u0 + u1) / 2, (v0 + v1) / 2), (u1 - u0, v1 - v0)),
        (CIRCLE_CENTRE, (2 * CIRCLE_RADIUS, 2 * CIRCLE_RADIUS)),
    )
    for topic, ((u, v), size) in zip(TABLE_SOLIDS, parts, strict=True):
        centre = METRES_PER_PIXEL * u, -METRES_PER_PIXEL * v
        colour = topic.name.rpartition("/")[2]
        records.append((topic, _box(TABLE_FRAME_ID, centre, size, colour, time_ns)))
    return records


class TableFrame:
    """Writes the table's frame; the message is built once and only its numbers change from step to step."""

    def __init__(self):
        self._transform = FrameTransform(parent_frame_id=FRAME, child_frame_id=TABLE_FRAME_ID)

    def record(self, time_ns: int, pose: Pose) -> Record:
        """The serialised FrameTransform of a pose (px, px, rad), with its topic."""
        transform = self._transform
        transform.timestamp.seconds, transform.timestamp.nanos = divmod(time_ns, 10**9)
        transform.translation.x, transform.translation.y = map(rounded, metres(pose[:2]))
        transform.rotation.z, transform.rotation.w = quaternion_zw(pose[2])
        return TABLE_FRAME, transform.SerializeToString()


def _box(frame: str, centre: tuple[float, float], size: tuple[float, float], colour: str, time_ns: int) -> bytes:
    """A box on the floor as a serialised VoxelGrid.

    Args:
        centre: x, y in the frame, m.
        size: along x and y, px.
    """
    rgba = COLOURS[colour]
    grid = VoxelGrid(frame_id=frame, row_count=1, column_count=1, slice_stride=4, row_stride=4, cell_stride=4)
    grid.timestamp.seconds, grid.timestamp.nanos = divmod(time_ns, 10**9)
    width, depth, height = (length - 2 * _INSET for length in (*(METRES_PER_PIXEL * side for side in size), HEIGHT))
    grid.cell_size.x, grid.cell_size.y, grid.cell_size.z = width, depth, height
    # A grid's pose is that of its lowest corner.
    grid.pose.position.x, grid.pose.position.y = centre[0] - width / 2, centre[1] - depth / 2
    grid.pose.position.z = _INSET
    grid.pose.orientation.w = 1.0
    for offset, name in enumerate(_CHANNELS):
        grid.fields.add(name=name, offset=offset, type=PackedElementField.UINT8)
    grid.data = bytes(round(255 * value) for value in (rgba.r, rgba.g, rgba.b, 1.0))
    return grid.SerializeToString()
