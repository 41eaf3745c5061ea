"""The topics of a recording: their names, the message type of each, and what their channels say about units."""

import functools
from dataclasses import dataclass, field
from typing import Any

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.VoxelGrid_pb2 import VoxelGrid
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.records import Channel, Schema
from mcap_protobuf.schema import build_file_descriptor_set

from copolicy.tasks.table.map_config import MAX_OBSTACLES

from ..task import PLAYERS
from .messages.copolicy_pb2 import EpisodeEvent, Interaction, LoopTiming, PlayerAction, PlayerInput, TableState

ENCODING = "protobuf"
"""Encoding of every message and of every schema."""

SCHEMA_PACKAGE = "copolicy."
"""What the name of every message of ours begins with, in every version."""

SCREEN_FRAME = "screen: origin top left, x right, y down, theta counter-clockwise on screen"
SCENE_FRAME = "world: x right, y up, z out of the screen; 1 px = 0.01 m"


@dataclass(frozen=True)
class Topic:
    """One stream of messages in a recording."""

    name: str
    message: Any  # class of a protobuf message
    metadata: dict[str, str] = field(default_factory=dict)  # of its channel: units, frame, player

    @property
    def schema_name(self) -> str:
        """Full name of the message, as the schema record has it."""
        return self.message.DESCRIPTOR.full_name


def _of_player(player: int) -> dict[str, str]:
    return {"player": str(player), "seat": PLAYERS[player]}


TABLE_STATE = Topic(
    "/table/state",
    TableState,
    {"units": "x, y: px; theta: rad; vx, vy: px/s; omega: rad/s; sim_time: s", "frame": SCREEN_FRAME},
)
INPUTS = tuple(
    Topic(f"/player/{player}/input", PlayerInput, {"units": "axes: [-1, 1]; age_ns: ns", **_of_player(player)})
    for player in range(2)
)
ACTIONS = tuple(
    Topic(
        f"/player/{player}/action",
        PlayerAction,
        {"units": "fx, fy: a player's full force, [-1, 1]", "frame": SCREEN_FRAME, **_of_player(player)},
    )
    for player in range(2)
)
INTERACTION = Topic("/interaction", Interaction, {"units": "force: a player's full force; positive pulls apart"})
LOOP_TIMING = Topic("/loop/timing", LoopTiming, {"units": "ns on the monotonic clock"})
EVENT = Topic("/episode/event", EpisodeEvent)
SCENE_MAP = Topic("/scene/map", SceneUpdate, {"units": "m", "frame": SCENE_FRAME})
SCENE = Topic("/scene", SceneUpdate, {"units": "m", "frame": SCENE_FRAME})

# The same scene in the messages that Rerun's importer maps, which SceneUpdate is not one of.
TABLE_FRAME = Topic("/scene/transform", FrameTransform, {"units": "m", "frame": SCENE_FRAME})
MAP_SOLIDS = tuple(
    Topic(f"/scene/solid/{name}", VoxelGrid, {"units": "m", "frame": SCENE_FRAME})
    for name in ("goal", *(f"obstacle_{slot}" for slot in range(MAX_OBSTACLES)))
)
TABLE_SOLIDS = tuple(
    Topic(f"/scene/solid/{name}", VoxelGrid, {"units": "m", "frame": "table: origin in its middle, turns with it"})
    for name in ("table", *PLAYERS)
)

TOPICS = (
    *(TABLE_STATE, *INPUTS, *ACTIONS, INTERACTION, LOOP_TIMING, EVENT),
    *(SCENE_MAP, SCENE, TABLE_FRAME, *MAP_SOLIDS, *TABLE_SOLIDS),
)
"""Every topic of a recording, in the order of its channels."""

_SCHEMA_NAMES = {(topic.name, topic.schema_name) for topic in TOPICS}


@functools.cache
def schema_data(message: Any) -> bytes:
    """The FileDescriptorSet of a message and all it needs, the `data` of its schema record."""
    return build_file_descriptor_set(message).SerializeToString(deterministic=True)


def is_ours(channel: Channel, schema_name: str) -> bool:
    """Whether a channel has the topic of one of ours, and its encoding and schema."""
    return channel.message_encoding == ENCODING and (channel.topic, schema_name) in _SCHEMA_NAMES


def channel_difference(channel: Channel, schema: Schema | None, topic: Topic) -> str:
    """What keeps messages of a file's channel from being read as those of a topic; empty where nothing does."""
    if schema is None:
        return f"{topic.name} without a schema"
    kind = (channel.message_encoding, schema.encoding, schema.name)
    if kind != (ENCODING, ENCODING, topic.schema_name):
        return f"{topic.name} with encodings and schema {kind}"
    difference = schema_difference(schema.data, topic.message)
    return difference and f"{topic.name} with {difference}"


@functools.cache
def schema_difference(data: bytes, message: Any) -> str:
    """What keeps our message class from decoding what a file's schema describes; empty where nothing does.

    A field of another type would not fail to decode, it would silently read as zero. Further fields are harmless.
    """
    if data == schema_data(message):
        return ""
    full_name = message.DESCRIPTOR.full_name
    theirs = {
        f"{file.package}.{kind.name}": {one.name: (one.number, one.type, one.label) for one in kind.field}
        for file in FileDescriptorSet.FromString(data).file
        for kind in file.message_type
    }
    if full_name not in theirs:
        return f"no message {full_name} in the schema"
    for ours in build_file_descriptor_set(message).file:
        for kind in ours.message_type:
            if f"{ours.package}.{kind.name}" == full_name:
                for one in kind.field:
                    if theirs[full_name].get(one.name) != (one.number, one.type, one.label):
                        return f"another field {one.name!r} in the schema of {full_name}"
    return ""
