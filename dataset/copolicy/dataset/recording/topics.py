"""The topics of a recording: their names, the message type of each, and what their channels say about units.

Those that depend on the task are in `task_messages`.
"""

import functools
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.records import Channel, Schema
from mcap_protobuf.schema import build_file_descriptor_set

from ..task_spec import PLAYERS
from .messages.copolicy_pb2 import EpisodeEvent, LoopTiming, PlayerInput

ENCODING = "protobuf"
"""Encoding of every message and of every schema."""

SCHEMA_PACKAGE = "copolicy."
"""What the name of every message of ours begins with, in every version."""


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


Record = tuple[Topic, bytes]
"""A serialised message and its topic."""


def player_metadata(player: int) -> dict[str, str]:
    """What the metadata of a channel says of a player."""
    return {"player": str(player), "seat": PLAYERS[player]}


INPUTS = tuple(
    Topic(f"/player/{player}/input", PlayerInput, {"units": "axes: [-1, 1]; age_ns: ns", **player_metadata(player)})
    for player in range(2)
)
LOOP_TIMING = Topic("/loop/timing", LoopTiming, {"units": "ns on the monotonic clock"})
EVENT = Topic("/episode/event", EpisodeEvent)


@functools.cache
def schema_data(message: Any) -> bytes:
    """The FileDescriptorSet of a message and all it needs, the `data` of its schema record."""
    return build_file_descriptor_set(message).SerializeToString(deterministic=True)


def is_channel_of(channel: Channel, schema_name: str, topics: Iterable[Topic]) -> bool:
    """Whether a channel has one of some topics, its encoding and its schema."""
    names = {(topic.name, topic.schema_name) for topic in topics}
    return channel.message_encoding == ENCODING and (channel.topic, schema_name) in names


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
