"""Reading a recording: exactly what was recorded, or an error of ours."""

import hashlib
import math
import struct
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorSet
from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.collect.recording.wall_clock import WallClockAnchor
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.recording.episode_records import decode_settings
from copolicy.dataset.recording.messages.copolicy_pb2 import PlayerAction, TableState
from copolicy.dataset.recording.reader import read_episode, read_metadata
from copolicy.dataset.settings_text import settings_text
from copolicy.dataset.task import get_task
from copolicy.tasks.table.features import state_vector
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.physics import Physics

MAP = MapConfig((240.0, 120.0, 3.14), (960.0, 180.0), ((480.0, 300.0), (0.1 + 0.2, 420.0)), 45)
META = EpisodeMeta(
    "uuid-1", "session-1", "P01", "P01-a", "P01-b", "joystick", "keyboard", "custom-1", "custom", 7, "human",
    consent_id="C-1", license="CC-BY-4.0", software_version="0.1.0",
)  # fmt: skip


def record(path, steps, seed=0):
    """A recording of arbitrary numbers, and those numbers: states `(steps + 1, 7)` and actions `(steps, 4)`."""
    rng = np.random.default_rng(seed)
    poses = np.column_stack((rng.uniform(0, 1200, steps + 1), rng.normal(size=steps + 1), rng.uniform(0, 7, steps + 1)))
    velocities = rng.normal(0, 30, (steps + 1, 3))
    actions = rng.uniform(-1, 1, (steps, 4))
    if steps:
        actions[0] = (-0.0, 5e-324, 1.0, -1.0)  # values that a format may lose
        velocities[0] = (-0.0, 0.0, 1e300)
    with EpisodeRecorder(
        path, MAP, META, WallClockAnchor.simulated(10**18), state=(*poses[0], *velocities[0])
    ) as recorder:
        for step in range(steps):
            recorder.step(actions[step], (*poses[step + 1], *velocities[step + 1]), 0.5)
        recorder.finish(True, "goal", achieved_hz=29.97, late_ticks=3, quality_flags="slow,short")
    states = np.array([state_vector(tuple(p), tuple(v)) for p, v in zip(poses, velocities, strict=True)])
    return states, actions


def rewrite(source, target, change, **options):
    """Copies a recording record by record; `change(record, topic)` gives the records to write in its place."""
    with source.open("rb") as old, target.open("wb") as new:
        writer = Writer(new, **{"enable_data_crcs": True, **options})
        writer.start()
        schemas, channels, topics = {}, {}, {}
        for original in StreamReader(old).records:
            topic = topics.get(original.channel_id, "") if isinstance(original, Message) else ""
            for one in change(original, topic):
                if isinstance(one, Schema) and one.id not in schemas:
                    schemas[one.id] = writer.register_schema(one.name, one.encoding, one.data)
                elif isinstance(one, Channel) and one.id not in channels:
                    topics[one.id] = one.topic
                    schema = schemas[one.schema_id]
                    channels[one.id] = writer.register_channel(one.topic, one.message_encoding, schema, one.metadata)
                elif isinstance(one, Message):
                    writer.add_message(channels[one.channel_id], one.log_time, one.data, one.publish_time)
                elif isinstance(one, Metadata):
                    writer.add_metadata(one.name, one.metadata)
                elif isinstance(one, Attachment):
                    writer.add_attachment(one.create_time, one.log_time, one.name, one.media_type, one.data)
        writer.finish()


def same_bits(left, right):
    return left.tobytes() == right.tobytes() and left.shape == right.shape


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "short.mcap"
    return path, *record(path, 40)


def refusal(path):
    with pytest.raises(FileFormatError) as caught:
        read_episode(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: expected ")
    assert "\n" not in message
    return message.removeprefix(f"{path}: expected ")


@pytest.mark.parametrize("steps", [0, 1, 40, 95])
def test_states_and_actions_come_back_bit_for_bit(tmp_path, steps):
    states, actions = record(tmp_path / "one.mcap", steps)
    episode = read_episode(str(tmp_path / "one.mcap"))
    assert same_bits(episode.states, states[:-1])
    assert same_bits(episode.final_state, states[-1])
    assert same_bits(episode.actions, actions)
    assert episode.fps == 30


def test_meta_map_and_digest_come_back(recording):
    path, *_ = recording
    episode = read_episode(path)
    assert episode.map_config == MAP
    expected = replace(
        META, success=True, termination_reason="goal", duration_s=40 / 30, achieved_hz=29.97, late_ticks=3,
        quality_flags="slow,short", source_sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        route_class=episode.meta.route_class, replay_drift_px=episode.meta.replay_drift_px,
        physics=settings_text(Physics()), obstacle_size=MAP.obstacle_size,
    )  # fmt: skip
    assert episode.meta == expected
    assert len(episode.meta.route_class) == 2
    assert np.isnan(episode.meta.replay_drift_px)


@pytest.mark.parametrize("set_name", sorted(MAP_SETS))
def test_maps_survive_their_json(set_name):
    for config in MAP_SETS[set_name]:
        assert MapConfig.from_json(config.to_json()) == config


def test_metadata_is_read_without_the_rest(recording):
    path, *_ = recording
    records = read_metadata(path)
    assert list(records) == [
        "session", "episode", "players", "devices", "software", "consent", "physics", "dataset_info", "episode_result",
    ]  # fmt: skip
    assert records["players"]["player_1_id"] == "P01-b"
    assert records["episode_result"]["steps"] == "40"


def test_metadata_of_a_recording_that_broke_off(recording, tmp_path):
    path, *_ = recording
    broken = tmp_path / "broken.mcap.part"
    broken.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert "episode_result" not in read_metadata(broken)
    assert read_metadata(broken)["consent"] == {"consent_id": "C-1", "license": "CC-BY-4.0"}


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b"", "an MCAP file, found an empty file"),
        (b"\x89PNG\r\n\x1a\nmore", "an MCAP file, found a PNG image"),
        (b"notes on the session", "an MCAP file, found a text file"),
    ],
)
def test_other_files_are_refused(tmp_path, content, found):
    path = tmp_path / "other.mcap"
    path.write_bytes(content)
    assert refusal(path) == found
    with pytest.raises(FileFormatError, match=found):
        read_metadata(path)


def test_missing_files_and_folders_are_refused(tmp_path):
    assert refusal(tmp_path / "none.mcap") == "a readable MCAP file, found No such file or directory"
    assert refusal(tmp_path) == "an MCAP file, found an empty folder"
    with pytest.raises(FileFormatError, match="found an empty folder"):
        read_metadata(tmp_path)


def test_every_shorter_file_is_refused(recording, tmp_path):
    """Cut after every record, around it, and at many places between."""
    path, *_ = recording
    content = path.read_bytes()
    ends, position = [8], 8
    while position < len(content) - 8:
        position += 9 + struct.unpack_from("<Q", content, position + 1)[0]
        ends.append(position)
    assert ends[-1] == len(content) - 8
    cuts = {end + shift for end in ends for shift in (-1, 0, 1, 9)} | set(range(0, len(content), 41))
    broken = tmp_path / "cut.mcap"
    for cut in sorted(cut for cut in cuts if cut < len(content)):
        broken.write_bytes(content[:cut])
        refusal(broken)


def test_appended_bytes_are_refused(recording, tmp_path):
    path, *_ = recording
    longer = tmp_path / "longer.mcap"
    longer.write_bytes(path.read_bytes() + b"\0")
    assert "found a wrong end of the file" in refusal(longer)


@pytest.mark.parametrize("kind", ["bit", "byte", "zeros", "removed", "repeated", "exchanged"])
def test_damage_never_gives_wrong_numbers(recording, tmp_path, kind):
    """600 damaged copies: each is refused with our error or is still exactly the episode."""
    path, states, actions = recording
    content = path.read_bytes()
    meta = replace(read_episode(path).meta, source_sha256="", replay_drift_px=0.0)
    rng = np.random.default_rng(list(kind.encode()))
    damaged = tmp_path / "damaged.mcap"
    refused = 0
    for _ in range(100):
        copy = bytearray(content)
        place, length = int(rng.integers(len(copy))), int(rng.integers(1, 64))
        other = int(rng.integers(len(copy)))
        if kind == "bit":
            copy[place] ^= 1 << int(rng.integers(8))
        elif kind == "byte":
            copy[place] ^= int(rng.integers(1, 256))
        elif kind == "zeros":
            copy[place : place + length] = bytes(len(copy[place : place + length]))
        elif kind == "removed":
            del copy[place : place + length]
        elif kind == "repeated":
            copy[place:place] = copy[place : place + length]
        else:
            copy[place], copy[other] = copy[other], copy[place]
        damaged.write_bytes(copy)
        try:
            episode = read_episode(damaged)
        except FileFormatError:
            refused += 1
            continue
        assert same_bits(np.vstack((episode.states, episode.final_state)), states)
        assert same_bits(episode.actions, actions)
        assert replace(episode.meta, source_sha256="", replay_drift_px=0.0) == meta
        assert episode.map_config == MAP
    assert refused >= 85


def drop(topic_to_drop, step):
    message = TableState if topic_to_drop == "/table/state" else PlayerAction

    def change(record, topic):
        return [] if topic == topic_to_drop and message.FromString(record.data).step == step else [record]

    return change


def edit_metadata(name, **entries):
    def change(record, topic):
        if isinstance(record, Metadata) and record.name == name:
            return [Metadata(name=name, metadata={**record.metadata, **entries})]
        return [record]

    return change


def edit_state(place, **values):
    def change(record, topic):
        if topic == "/table/state" and (state := TableState.FromString(record.data)).step == place:
            for name, value in values.items():
                setattr(state, name, value)
            record.data = state.SerializeToString()
        return [record]

    return change


def full_force(record, topic):
    if topic == "/player/1/action":
        record.data = PlayerAction(step=PlayerAction.FromString(record.data).step, fx=1.0000001).SerializeToString()
    return [record]


def single_precision(record, topic):
    """The file of a program whose x is a float: it would decode as zeros."""
    if isinstance(record, Schema) and record.name == "copolicy.v1.TableState":
        files = FileDescriptorSet.FromString(record.data)
        fields = files.file[0].message_type[0].field
        next(field for field in fields if field.name == "x").type = FieldDescriptorProto.TYPE_FLOAT
        record.data = files.SerializeToString()
    return [record]


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (drop("/table/state", 0), "states of 40 steps and the final one, found 40 states"),
        (drop("/table/state", 40), "states of 40 steps and the final one, found 40 states"),
        (drop("/player/0/action", 17), "steps 0 to 39 in /player/0/action, found 39 messages"),
        (edit_state(5, step=6), "steps 0 to 40 in /table/state, found step 6 in place 5"),
        (edit_state(5, vx=float("nan")), "finite states, found others"),
        (full_force, "actions in [-1, 1], found others"),
        (single_precision, "another field 'x' in the schema of copolicy.v1.TableState"),
        (lambda r, _: [] if isinstance(r, Attachment) else [r], "an attachment 'map_config.json', found none"),
        (lambda r, _: [] if isinstance(r, Metadata) and r.name == "consent" else [r], "expected a record 'consent'"),
        (lambda r, _: [r, r] if isinstance(r, Metadata) else [r], "a second metadata record 'session'"),
        (edit_metadata("dataset_info", fps="10"), "a recording at 30 Hz, found fps '10'"),
        (
            edit_metadata("dataset_info", schema_version="2"),
            "schema version 1, the latest supported, found schema version '2'",
        ),
        (edit_metadata("episode", seed="x"), "metadata entry 'seed': expected int, found 'x'"),
        (edit_metadata("episode_result", success="yes"), "metadata entry 'success': expected bool, found 'yes'"),
        (edit_metadata("episode", source="robot"), "metadata entry 'source': expected one of"),
        (edit_metadata("episode_result", steps="39"), "states of 39 steps and the final one, found 41 states"),
    ],
)
def test_intact_files_that_are_no_whole_episode_are_refused(recording, tmp_path, change, found):
    path, *_ = recording
    target = tmp_path / "changed.mcap"
    rewrite(path, target, change)
    assert found in refusal(target)


@pytest.mark.parametrize(
    "options", [{}, {"compression": CompressionType.NONE}, {"use_chunking": False}, {"chunk_size": 500}]
)
def test_other_layouts_of_the_same_records_are_read(recording, tmp_path, options):
    path, states, actions = recording
    target = tmp_path / "layout.mcap"
    rewrite(path, target, lambda record, topic: [record], **options)
    episode = read_episode(target)
    assert same_bits(episode.states, states[:-1])
    assert same_bits(episode.actions, actions)


def test_memory_is_bounded_by_the_numbers_not_by_the_file(tmp_path):
    steps = 6000
    source, padded = tmp_path / "long.mcap", tmp_path / "padded.mcap"
    states, _ = record(source, steps)
    video = Attachment(0, 0, "video.mp4", "video/mp4", bytes(48 << 20))
    rewrite(source, padded, lambda one, topic: [one, video] if isinstance(one, Attachment) else [one])
    assert padded.stat().st_size > 48 << 20
    tracemalloc.start()
    try:
        episode = read_episode(padded)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert same_bits(episode.final_state, states[-1])
    numbers = steps * 8 * (7 + 4)
    assert peak < 4 * numbers + (6 << 20)


def test_the_physics_of_a_recording_come_back(tmp_path):
    physics = Physics(angular_acceleration_limit=math.pi / 8, step_limit=77)
    path = tmp_path / "episode.mcap"
    with EpisodeRecorder(path, MAP_SETS["training"][0], EpisodeMeta("eighth"), settings=physics) as recorder:
        recorder.finish(False, "operator_discard")
    assert read_episode(path).physics == physics


def test_a_recording_without_its_physics_is_refused():
    with pytest.raises(InvalidValueError) as error:
        decode_settings({"physics": {"angular_acceleration_limit": "fast"}}, get_task())
    assert str(error.value) == (
        "metadata record 'physics', entry 'angular_acceleration_limit': expected a number, found 'fast'"
    )
