"""The topics of a recording that do not depend on the task: names, message types and channel metadata.

See `task_messages` for the other topics.
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
"""Prefix of the names of our messages, in every version."""


@dataclass(frozen=True)
class Topic:
    """A topic: name, message type and metadata of its channel."""

    name: str
    message: Any  # class of a protobuf message
    metadata: dict[str, str] = field(default_factory=dict)  # of its channel: units, frame, player

    @property
    def schema_name(self) -> str:
        """Full name of the message type, as in the schema record."""
        return self.message.DESCRIPTOR.full_name


Record = tuple[Topic, bytes]
"""A serialised message and its topic."""


def player_metadata(player: int) -> dict[str, str]:
    """Channel metadata of a topic of one player."""
    return {"player": str(player), "seat": PLAYERS[player]}


INPUTS = tuple(
    Topic(f"/player/{player}/input", PlayerInput, {"units": "axes: [-1, 1]; age_ns: ns", **player_metadata(player)})
    for player in range(2)
)
LOOP_TIMING = Topic("/loop/timing", LoopTiming, {"units": "ns on the monotonic clock"})
EVENT = Topic("/episode/event", EpisodeEvent)


@functools.cache
def schema_data(message: Any) -> bytes:
    """Serialised FileDescriptorSet of a message type with its dependencies, the `data` of its schema record."""
    return build_file_descriptor_set(message).SerializeToString(deterministic=True)


def is_channel_of(channel: Channel, schema_name: str, topics: Iterable[Topic]) -> bool:
    """Whether a channel has the name, encoding and schema of one of the topics."""
    pairs = {(topic.name, topic.schema_name) for topic in topics}
    return channel.message_encoding == ENCODING and (channel.topic, schema_name) in pairs


def channel_difference(channel: Channel, schema: Schema | None, topic: Topic) -> str:
    """Reason why messages of a channel cannot be read as those of a topic; empty if they can."""
    if schema is None:
        return f"{topic.name} without a schema"
    types = (channel.message_encoding, schema.encoding, schema.name)
    if types != (ENCODING, ENCODING, topic.schema_name):
        return f"{topic.name} with encodings and schema {types}"
    difference = schema_difference(schema.data, topic.message)
    return difference and f"{topic.name} with {difference}"


@functools.cache
def schema_difference(data: bytes, message: Any) -> str:
    """Reason why our message class cannot decode messages of a file's schema; empty if it can.

    A field of another type would not fail to decode but silently read as zero. Additional fields are harmless.
    """
    if data == schema_data(message):
        return ""
    full_name = message.DESCRIPTOR.full_name
    fields_in_file = {
        f"{file.package}.{message_type.name}": {f.name: (f.number, f.type, f.label) for f in message_type.field}
        for file in FileDescriptorSet.FromString(data).file
        for message_type in file.message_type
    }
    if full_name not in fields_in_file:
        return f"no message {full_name} in the schema"
    for file in build_file_descriptor_set(message).file:
        for message_type in file.message_type:
            if f"{file.package}.{message_type.name}" == full_name:
                for field in message_type.field:
                    if fields_in_file[full_name].get(field.name) != (field.number, field.type, field.label):
                        return f"another field {field.name!r} in the schema of {full_name}"
    return ""
