"""The episode in a recovered recording: up to the last complete step, marked, with all topics and metadata."""

import hashlib
from dataclasses import replace

import pytest
from benchmarks import damage
from broken_recordings import MAP, META, finished, truncated
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.VoxelGrid_pb2 import VoxelGrid
from mcap.records import Channel, Message, Metadata
from mcap.stream_reader import StreamReader
from mcap_variants import library_records, write

from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.collect.recording.recover import recover, recover_file
from copolicy.collect.recording.wall_clock import WallClockAnchor
from copolicy.dataset.recording.messages.copolicy_pb2 import EpisodeEvent, LoopTiming, PlayerInput, TableState
from copolicy.dataset.recording.reader import read_episode, read_metadata
from copolicy.tasks.table.world import TableWorld


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "episode.mcap"
    return path, finished(path)


def messages(path, message, channel_topic):
    decoded, channels = [], {}
    with path.open("rb") as file:
        for record in StreamReader(file).records:
            if isinstance(record, Channel):
                channels[record.id] = record.topic
            elif isinstance(record, Message) and channels[record.channel_id] == channel_topic:
                decoded.append((record.log_time, record.sequence, message.FromString(record.data)))
    return decoded


def test_a_broken_recording_becomes_an_episode_up_to_its_last_complete_step(tmp_path, whole):
    truth_path, truth = whole
    part = truncated(tmp_path / "episode.mcap.part", truth_path, 3)  # start event, steps 0-26, 27-53
    before = part.read_bytes()
    (recovery,) = recover(tmp_path)
    output = tmp_path / "episode.recovered.mcap"
    assert (recovery.status, recovery.output, recovery.steps) == ("recovered", output, 53)
    assert part.read_bytes() == before
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["episode.mcap.part", "episode.recovered.mcap"]
    episode = read_episode(output)
    assert episode.states.tobytes() == truth.states[:53].tobytes()
    assert episode.actions.tobytes() == truth.actions[:53].tobytes()
    assert episode.final_state.tobytes() == truth.states[53].tobytes()
    assert episode.map_config == MAP
    expected = replace(
        META, termination_reason="crash_recovered", quality_flags="slow_loop,recovered", duration_s=53 / 30,
        route_class=episode.meta.route_class, source_sha256=hashlib.sha256(output.read_bytes()).hexdigest(),
        achieved_hz=episode.meta.achieved_hz, late_ticks=1, replay_drift_px=episode.meta.replay_drift_px,
        physics=truth.meta.physics, obstacle_size=MAP.obstacle_size,
    )  # fmt: skip
    assert episode.meta.achieved_hz == pytest.approx(30.0)
    assert episode.meta == expected
    assert len(episode.meta.route_class) == len(MAP.obstacles)


def test_the_recovery_record_describes_the_source(tmp_path, whole):
    part = truncated(tmp_path / "episode.mcap.part", whole[0], 3)
    recover(tmp_path)
    metadata = read_metadata(tmp_path / "episode.recovered.mcap")
    summary = metadata["recovery"]
    assert summary["source"] == "episode.mcap.part"
    assert summary["source_sha256"] == hashlib.sha256(part.read_bytes()).hexdigest()
    assert (summary["source_bytes"], summary["steps"]) == (str(part.stat().st_size), "53")
    assert summary["stopped_by"].startswith("expected an intact and complete MCAP file, found its end at byte")
    assert metadata["consent"] == {"consent_id": "C-1", "license": "CC-BY-4.0"}


def test_every_topic_is_copied_with_its_times_up_to_the_same_step(tmp_path, whole):
    truth_path, _ = whole
    truncated(tmp_path / "episode.mcap.part", truth_path, 4)  # the event at step 61 closed a chunk
    recover(tmp_path)
    output = tmp_path / "episode.recovered.mcap"
    for topic, message, count in (
        ("/table/state", TableState, 61),
        ("/player/1/input", PlayerInput, 60),
        ("/loop/timing", LoopTiming, 60),
    ):
        assert messages(output, message, topic) == messages(truth_path, message, topic)[:count]
    for topic, message in (("/scene", SceneUpdate), ("/scene/transform", FrameTransform)):
        copied, truth = (messages(file, message, topic) for file in (output, truth_path))
        assert copied[:60] == truth[:60]
        assert [step for _, step, _ in copied] == list(range(61))
        assert copied[60][0] == truth[60][0]
    assert copied[60] == truth[60]  # the table's frame; in the scene no force acts any more
    solid = messages(output, VoxelGrid, "/scene/solid/table")
    assert solid == messages(truth_path, VoxelGrid, "/scene/solid/table")
    assert len(solid) == 1
    events = [(step, event.kind) for _, step, event in messages(output, EpisodeEvent, "/episode/event")]
    assert events == [(0, "start"), (60, "recovered")]


def test_a_part_of_an_earlier_version_is_recovered_without_what_it_did_not_record(tmp_path, whole):
    truth_path, truth = whole
    earlier = tmp_path / "earlier.mcap"
    channel_ids = {
        record.id for record in library_records(truth_path) if isinstance(record, Channel) and not later(record)
    }
    records = [
        record
        for record in library_records(truth_path)
        if not (isinstance(record, Channel) and later(record))
        and not (isinstance(record, Message) and record.channel_id not in channel_ids)
    ]
    write(records, earlier, chunk_size=8192)
    episode = read_episode(earlier)
    assert (episode.states == truth.states).all()
    part = truncated(tmp_path / "episode.mcap.part", earlier, 3)
    recover(tmp_path)
    output = part.with_name("episode.recovered.mcap")
    recovered = read_episode(output)
    assert 10 < len(recovered.states) < 95
    assert recovered.states.tobytes() == truth.states[: len(recovered.states)].tobytes()
    assert len(messages(output, SceneUpdate, "/scene")) == len(recovered.states) + 1
    with output.open("rb") as file:
        assert not [record for record in StreamReader(file).records if isinstance(record, Channel) and later(record)]


def later(channel: Channel) -> bool:
    """Whether earlier versions had no such channel."""
    return channel.topic.startswith(("/scene/transform", "/scene/solid/"))


def test_events_of_the_session_are_recovered(tmp_path):
    """A kill while the players look at the result, in a practice episode."""
    path = tmp_path / "episode.mcap"
    world = TableWorld(MAP)
    recording = EpisodeRecorder(path, MAP, META, WallClockAnchor.simulated(10**18)).__enter__()
    recording.event("practice")
    recording.event("stick_off_centre", "human: pushes with 0.15 at rest")
    for _ in range(40):
        world.step((1.0, 0.0, 1.0, 0.0))
        recording.step((1.0, 0.0, 1.0, 0.0), world.recorded, world.reward())
    recording.event("pause", "focus lost")
    recording.event("note", "the phone rang")
    recording.event("outcome", "timeout")
    part = tmp_path / "copy.mcap.part"
    part.write_bytes((tmp_path / "episode.mcap.part").read_bytes())
    recording.finish(False, "timeout")
    recover_file(part)
    episode = read_episode(tmp_path / "copy.recovered.mcap")
    assert len(episode.actions) == 39
    meta = episode.meta
    assert meta.quality_flags == "practice,paused,stick_off_centre,recovered"
    assert meta.discarded
    notes = read_metadata(tmp_path / "copy.recovered.mcap")["episode_result"]["notes"]
    assert notes == "the phone rang; ended at step 40 with timeout, without a verdict"


def test_an_episode_of_one_device_is_flagged_after_a_crash_too(tmp_path):
    path = tmp_path / "episode.mcap"
    world, meta = TableWorld(MAP), replace(META, controller_1="joystick")
    with EpisodeRecorder(path, MAP, meta, WallClockAnchor.simulated(10**18)) as recording:
        for step in range(40):
            world.step((0.02 * step, 0.5) * 2)
            recording.step((0.02 * step, 0.5) * 2, world.recorded, world.reward())
        recording.event("pause", "player")
        part = tmp_path / "copy.mcap.part"
        part.write_bytes((tmp_path / "episode.mcap.part").read_bytes())
    recover_file(part)
    assert read_episode(tmp_path / "copy.recovered.mcap").meta.quality_flags == "paused,identical_actions,recovered"


def test_a_complete_file_that_only_lacks_its_name_keeps_its_result(tmp_path, whole):
    truth_path, truth = whole
    (tmp_path / "episode.mcap.part").write_bytes(truth_path.read_bytes())
    (recovery,) = recover(tmp_path)
    assert (recovery.status, recovery.steps, recovery.detail) == (
        "recovered",
        95,
        "it was complete except for its name",
    )
    episode = read_episode(tmp_path / "episode.recovered.mcap")
    assert episode.final_state.tobytes() == truth.final_state.tobytes()
    meta = episode.meta
    assert (meta.success, meta.termination_reason, meta.quality_flags) == (True, "goal", "recovered")


def test_damage_within_a_recording_ends_the_episode_before_it(tmp_path, whole):
    truth_path, truth = whole
    part = truncated(tmp_path / "episode.mcap.part", truth_path, 5)
    content = bytearray(part.read_bytes())
    chunks = [begin for begin, _ in damage.record_spans(truth_path.read_bytes()) if content[begin : begin + 1] == b"\6"]
    third = chunks[2]
    content[third + 200] ^= 1  # in the chunk of steps 27-53
    part.write_bytes(content)
    (recovery,) = recover(tmp_path)
    assert (recovery.status, recovery.steps) == ("recovered", 26)
    assert "expected an intact and complete MCAP file, found damage (" in recovery.detail
    assert read_episode(tmp_path / "episode.recovered.mcap").actions.tobytes() == truth.actions[:26].tobytes()


def test_metadata_of_the_source_stays_in_order(tmp_path, whole):
    truncated(tmp_path / "episode.mcap.part", whole[0], 3)
    recover(tmp_path)
    with (tmp_path / "episode.recovered.mcap").open("rb") as file:
        names = [record.name for record in StreamReader(file).records if isinstance(record, Metadata)]
    assert names == [
        "session", "episode", "players", "devices", "software", "consent", "physics", "dataset_info",
        "episode_result", "recovery",
    ]  # fmt: skip
