"""Recording: content of the file."""

import math
import re
import socket
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Attachment, Chunk, DataEnd, Header, Metadata
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory
from recorded_steps import ACTION, MAP, META, START_NS, carry, recorder, records

from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.collect.recording.wall_clock import WallClockAnchor
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.recording.messages.copolicy_pb2 import LoopTiming, PlayerInput
from copolicy.dataset.recording.reader import read_episode, read_metadata

SOLIDS = ("goal", *(f"obstacle_{slot}" for slot in range(len(MAP.obstacles))), "table", "robot", "human")


def decoded(path):
    """Messages by topic as (log time, message), decoded with nothing but the schemas in the file."""
    messages: dict[str, list] = {}
    with path.open("rb") as file:
        for _, channel, message, proto in make_reader(
            file, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            messages.setdefault(channel.topic, []).append((message.log_time, proto))
    return messages


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    path = tmp_path_factory.mktemp("recorder") / "episode.mcap"
    with recorder(path) as recording:
        world = carry(recording, 95)
        recording.finish(False, "timeout")
    return path, world, recording


def test_a_finished_recording_has_its_name_and_nothing_beside_it(finished):
    path, world, recording = finished
    assert [entry.name for entry in path.parent.iterdir()] == ["episode.mcap"]
    episode = read_episode(path)
    assert (episode.final_state == world.observation).all()
    assert (episode.actions == ACTION).all()
    assert episode.meta.termination_reason == "timeout"
    assert recording.meta.duration_s == episode.meta.duration_s == 95 / 30


def test_other_programs_decode_it_by_its_own_schemas(finished):
    path, world, _ = finished
    messages = decoded(path)
    assert {topic: len(topic_messages) for topic, topic_messages in messages.items()} == {
        "/table/state": 96,
        "/player/0/action": 95,
        "/player/1/action": 95,
        "/interaction": 95,
        "/episode/event": 2,
        "/scene": 96,
        "/scene/map": 1,
        "/scene/transform": 96,
        **{f"/scene/solid/{name}": 1 for name in SOLIDS},
    }
    time_ns, state = messages["/table/state"][30]
    assert (state.step, state.sim_time, time_ns) == (30, 1.0, START_NS + 10**9)
    assert (messages["/player/1/action"][7][1].fx, messages["/player/1/action"][7][1].fy) == (1.0, 0.0)
    _, last = messages["/interaction"][-1]
    x, y = math.cos(world.pose[2]), -math.sin(world.pose[2])
    assert last.force == pytest.approx(((0.5 - 1.0) * x + (-0.25 - 0.0) * y) / 2, abs=1e-12)
    assert last.reward == world.reward()
    events = [(event.step, event.kind, event.detail) for _, event in messages["/episode/event"]]
    assert events == [(0, "start", ""), (95, "end", "timeout")]


def test_records_that_describe_the_file(finished):
    path, *_ = finished
    (header,) = records(path, Header)
    assert header.profile == ""
    assert re.fullmatch(r"copolicy/\S+ mcap-python/1\.\S+", header.library)
    (end,) = records(path, DataEnd)
    assert end.data_section_crc != 0
    (attachment,) = records(path, Attachment)
    assert (attachment.name, attachment.media_type) == ("map_config.json", "application/json")
    names = [record.name for record in records(path, Metadata)]
    assert names == [
        "session", "episode", "players", "devices", "software", "consent", "physics", "dataset_info", "episode_result",
    ]  # fmt: skip
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    channels = {channel.topic: channel for channel in summary.channels.values()}
    assert channels["/player/1/input"].metadata["seat"] == "human"
    assert channels["/table/state"].metadata["units"].startswith("x, y: px; theta: rad")
    assert {schema.name for schema in summary.schemas.values()} == {
        "copolicy.v1.TableState", "copolicy.v1.PlayerInput", "copolicy.v1.PlayerAction", "copolicy.v1.Interaction",
        "copolicy.v1.LoopTiming", "copolicy.v1.EpisodeEvent", "foxglove.SceneUpdate",
        "foxglove.FrameTransform", "foxglove.VoxelGrid",
    }  # fmt: skip


def test_the_file_is_flushed_within_every_second_and_at_every_event(finished):
    path, *_ = finished
    ends = [chunk.message_end_time - START_NS for chunk in records(path, Chunk, emit_chunks=True)]
    # Start event, steps 0-26, 27-53, 54-80, the rest with the end event.
    assert ends == [0, *(step * 10**9 // 30 for step in (26, 53, 80, 95))]


def test_the_scene_is_in_metres_with_y_up(finished):
    path, world, _ = finished
    messages = decoded(path)
    still = {entity.id: entity for entity in messages["/scene/map"][0][1].entities}
    assert list(still) == ["goal", *(f"obstacle_{i}" for i in range(len(MAP.obstacles))), "window"]
    goal = still["goal"].cubes[0]
    assert (goal.pose.position.x, goal.pose.position.y) == pytest.approx((MAP.goal[0] / 100, 6 - MAP.goal[1] / 100))
    assert goal.size.x == pytest.approx(0.92)
    moving = {entity.id: entity for entity in messages["/scene"][-2][1].entities}
    assert list(moving) == ["table", "robot", "human"]
    # The force of step 94 is drawn where the table was then: at its start theta is near pi, the robot on the left.
    robot, human = moving["robot"].arrows[0], moving["human"].arrows[0]
    assert robot.pose.position.x < moving["table"].cubes[0].pose.position.x < human.pose.position.x
    assert (robot.shaft_length, human.shaft_length) == pytest.approx((math.hypot(0.5, 0.25), 1.0), abs=2e-4)
    yaw = 2 * math.atan2(robot.pose.orientation.z, robot.pose.orientation.w)
    assert (math.cos(yaw), math.sin(yaw)) == pytest.approx((math.sqrt(0.8), math.sqrt(0.2)), abs=1e-3)
    circle = {entity.id: entity for entity in messages["/scene"][-1][1].entities}["human"].cylinders[0]
    x, y, theta = world.pose
    assert (circle.pose.position.x, circle.pose.position.y) == pytest.approx(
        ((x - 78 * math.cos(theta)) / 100, 6 - (y + 78 * math.sin(theta)) / 100), abs=2e-4
    )
    assert moving["table"].timestamp.seconds == START_NS // 10**9 + 3


def box(grid) -> tuple[list[float], list[float]]:
    """Lowest and highest corner of a grid of one cell, m."""
    low, size = grid.pose.position, grid.cell_size
    return [low.x, low.y, low.z], [low.x + size.x, low.y + size.y, low.z + size.z]


def test_viewers_without_scene_updates_get_boxes_and_the_tables_frame(finished):
    path, world, _ = finished
    messages = decoded(path)
    still = {entity.id: entity.cubes[0] for entity in messages["/scene/map"][0][1].entities if entity.cubes}
    for name, cube in still.items():
        time_ns, grid = messages[f"/scene/solid/{name}"][0]
        assert (time_ns, grid.frame_id, grid.row_count, grid.column_count) == (START_NS, "world", 1, 1)
        centre, size = cube.pose.position, cube.size
        expected = [[at + end * side / 2 for at, side in zip(numbers(centre), numbers(size), strict=True)]
                    for end in (-1, 1)]  # fmt: skip
        np.testing.assert_allclose(box(grid), expected, atol=0.003)  # just inside, so that nothing flickers
        channels = {field.name: grid.data[field.offset] / 255 for field in grid.fields}
        assert channels["red"] == pytest.approx(cube.color.r, abs=0.01)
        assert channels["alpha"] == 1.0
    low, high = zip(*(box(messages[f"/scene/solid/{name}"][0][1]) for name in ("human", "table", "robot")), strict=True)
    assert [grid[1].frame_id for name in ("table", "robot", "human") for grid in messages[f"/scene/solid/{name}"]] == [
        "table"
    ] * 3
    left, right = np.array(low)[:, 0], np.array(high)[:, 0]
    np.testing.assert_allclose([left, right], [[-0.955, -0.565, 0.555], [-0.605, 0.515, 0.955]], atol=0.003)
    for step in (0, 60, 95):
        time_ns, frame = messages["/scene/transform"][step]
        state = messages["/table/state"][step][1]
        assert (frame.parent_frame_id, frame.child_frame_id) == ("world", "table")
        assert time_ns == frame.timestamp.seconds * 10**9 + frame.timestamp.nanos == START_NS + step * 10**9 // 30
        assert (frame.translation.x, frame.translation.y) == pytest.approx((state.x / 100, 6 - state.y / 100), abs=2e-4)
        yaw = 2 * math.atan2(frame.rotation.z, frame.rotation.w)
        assert math.cos(yaw - state.theta) == pytest.approx(1, abs=1e-6)
    assert (state.x, state.y) == world.pose[:2]


def numbers(vector) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def test_a_real_time_recording_keeps_the_clock_of_its_session(tmp_path):
    path = tmp_path / "live.mcap"
    anchor = WallClockAnchor(START_NS, 5_000)
    with EpisodeRecorder(path, MAP, META, anchor, monotonic_ns=6_000, devices={"player_0": "gamepad"}) as recording:
        for step, began in enumerate((7_000, 40_000_000)):
            inputs = (PlayerInput(axes=[0.1, -0.9], buttons=[False, True], age_ns=12), None)
            timing = LoopTiming(scheduled_ns=began - 1, start_ns=began, late_ns=1, work_ns=900)
            recording.step(ACTION, (*MAP.start, 0, 0, 0), 0.0, monotonic_ns=began, inputs=inputs, timing=timing)
            if step == 0:
                recording.event("pause", "focus lost", monotonic_ns=20_000)
        recording.finish(True, "goal", achieved_hz=25.0, late_ticks=1, notes="a note")
    messages = decoded(path)
    assert [time_ns - START_NS for time_ns, _ in messages["/table/state"]] == [2_000, 39_995_000, 73_328_333]
    assert [message.monotonic_ns for _, message in messages["/table/state"]][:2] == [7_000, 40_000_000]
    (_, sample), (time_ns, second) = messages["/player/0/input"]
    assert (list(sample.axes), list(sample.buttons), sample.age_ns) == ([0.1, -0.9], [False, True], 12)
    assert (second.step, time_ns - START_NS) == (1, 39_995_000)
    assert "/player/1/input" not in messages
    assert [(timing.step, timing.start_ns) for _, timing in messages["/loop/timing"]] == [(0, 7_000), (1, 40_000_000)]
    assert [event.kind for _, event in messages["/episode/event"]] == ["start", "pause", "end"]
    episode = read_episode(path)
    assert (episode.meta.achieved_hz, episode.meta.late_ticks) == (25.0, 1)
    metadata = read_metadata(path)
    assert metadata["devices"] == {"player_0": "gamepad"}
    assert metadata["session"]["started_at"] == "2023-11-14T22:13:20.000+00:00"
    assert metadata["episode_result"]["notes"] == "a note"


def test_nothing_about_the_machine_or_its_user_is_recorded(tmp_path, monkeypatch):
    secrets = {
        "USER": "zq-user", "LOGNAME": "zq-logname", "HOME": "/home/zq-home", "HF_TOKEN": "hf_zqtoken",
        "HOSTNAME": "zq-host", "AWS_SECRET_ACCESS_KEY": "zq-secret",
    }  # fmt: skip
    for name, value in secrets.items():
        monkeypatch.setenv(name, value)
    path = tmp_path / "episode.mcap"
    with recorder(path) as recording:
        carry(recording, 5)
        recording.finish(True, "goal")
    content = path.read_bytes()
    with path.open("rb") as file:
        for record in StreamReader(file).records:
            content += repr(record).encode()
    for secret in (*secrets.values(), socket.gethostname(), str(tmp_path), str(Path(sys.prefix)), str(Path.cwd())):
        assert secret.encode() not in content


def test_a_long_recording_is_on_the_disk_not_in_memory(tmp_path):
    """Only positions for the route class (16 bytes a step) and the index of chunks (one a second) stay in memory."""
    steps = 3000
    with recorder(tmp_path / "episode.mcap") as recording:
        carry(recording, 100)
        tracemalloc.start()
        try:
            carry(recording, steps)
            memory, _ = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        recording.finish(False, "timeout")
    assert memory < 200 * steps


@pytest.mark.parametrize(
    ("action", "changes", "expected"),
    [
        ((0.5, -0.25, 0.5, -0.25), {}, "paused,identical_actions"),
        ((0.0, 0.0, 0.0, 0.0), {}, "paused"),
        ((0.5, -0.25, 0.5, 0.25), {}, "paused"),
        ((0.5, -0.25, 0.5, -0.25), {"controller_1": "keyboard"}, "paused"),
        ((0.5, -0.25, 0.5, -0.25), {"source": "simulated"}, "paused"),
    ],
)
def test_an_episode_in_which_one_gamepad_moved_both_is_flagged(tmp_path, action, changes, expected):
    path = tmp_path / "episode.mcap"
    people = {"source": "human", "controller_0": "joystick", "controller_1": "joystick"}
    meta = EpisodeMeta("uuid-1", **(people | changes))
    with EpisodeRecorder(path, MAP, meta, WallClockAnchor.simulated(START_NS)) as recording:
        carry(recording, 12, action)
        recording.finish(False, "timeout", quality_flags="paused")
    assert read_episode(path).meta.quality_flags == expected
