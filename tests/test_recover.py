"""Recovery of incomplete recordings: up to the last complete step, marked, verified, and nothing deleted."""

import hashlib
import json
import re
import subprocess
import sys
import tracemalloc
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from benchmarks import damage, kill
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.VoxelGrid_pb2 import VoxelGrid
from mcap.records import Channel, Message, Metadata
from mcap.stream_reader import StreamReader
from mcap_variants import library_records, write

from copolicy.collect.cli import main
from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.collect.recording.recover import recover, recover_file
from copolicy.collect.recording.wall_clock import WallClockAnchor
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.exceptions import FileFormatError, OutputExistsError
from copolicy.dataset.recording.messages.copolicy_pb2 import EpisodeEvent, LoopTiming, PlayerInput, TableState
from copolicy.dataset.recording.reader import read_episode, read_metadata
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.world import TableWorld

MAP = MAP_SETS["training"][6]
META = EpisodeMeta(
    "uuid-1", "session-1", "P01", "P01-a", "P01-b", "joystick", "keyboard", "training-06", "training", 7, "human",
    consent_id="C-1", license="CC-BY-4.0", software_version="0.1.0",
)  # fmt: skip


def finished(path, steps=95):
    """A finished recording, with inputs and timing; returns its episode."""
    world = TableWorld(MAP)
    rng = np.random.default_rng(0)
    with EpisodeRecorder(path, MAP, META, WallClockAnchor.simulated(10**18)) as recording:
        for step in range(steps):
            action = rng.uniform(-1, 1, 4)
            world.step(action)
            inputs = (PlayerInput(axes=[0.1, 0.2]), PlayerInput(axes=[0.3]))
            began = step * 10**9 // 30
            timing = LoopTiming(scheduled_ns=began, start_ns=began + (20_000_000 if step == 9 else 0))
            recording.step(action, world.recorded, world.reward(), inputs=inputs, timing=timing)
            if step == 60:
                recording.event("pause", "focus lost")
        recording.finish(True, "goal")
    return read_episode(path)


def truncated(path, truth_path, chunks):
    """Writes the beginning of a recording, up to a number of chunks."""
    content = truth_path.read_bytes()
    begins = [begin for begin, _ in damage.record_spans(content) if content[begin] == 0x06]
    path.write_bytes(content[: begins[chunks]])
    return path


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


def test_a_second_run_does_nothing(tmp_path, whole):
    truncated(tmp_path / "episode.mcap.part", whole[0], 3)
    recover(tmp_path)
    output = tmp_path / "episode.recovered.mcap"
    content, modified = output.read_bytes(), output.stat().st_mtime_ns
    (recovery,) = recover(tmp_path, finished=True)
    assert (recovery.status, recovery.output, recovery.steps) == ("already_recovered", output, 53)
    assert (output.read_bytes(), output.stat().st_mtime_ns) == (content, modified)


def test_a_name_that_is_taken_is_not_overwritten(tmp_path, whole):
    part = truncated(tmp_path / "episode.mcap.part", whole[0], 3)
    output = tmp_path / "episode.recovered.mcap"
    output.write_bytes(whole[0].read_bytes())
    with pytest.raises(OutputExistsError, match=re.escape(str(output))):
        recover_file(part)
    assert output.read_bytes() == whole[0].read_bytes()


def test_what_an_interrupted_run_left_is_started_anew(tmp_path, whole):
    truncated(tmp_path / "episode.mcap.part", whole[0], 3)
    (tmp_path / "episode.recovered.mcap.unfinished").write_bytes(b"half")
    (recovery,) = recover(tmp_path)
    assert recovery.status == "recovered"
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["episode.mcap.part", "episode.recovered.mcap"]


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


def test_parts_in_folders_below_are_found(tmp_path, whole):
    (tmp_path / "a" / "b").mkdir(parents=True)
    truncated(tmp_path / "a" / "b" / "one.mcap.part", whole[0], 3)
    assert [recovery.source.name for recovery in recover(tmp_path)] == ["one.mcap.part"]
    assert (tmp_path / "a" / "b" / "one.recovered.mcap").exists()


@pytest.mark.parametrize("chunks", [0, 1])
def test_a_recording_without_a_complete_step_stays_as_it_is(tmp_path, whole, chunks):
    truncated(tmp_path / "episode.mcap.part", whole[0], chunks)
    (recovery,) = recover(tmp_path)
    assert (recovery.status, recovery.detail) == ("empty", "it ends before the first complete step")
    assert [entry.name for entry in tmp_path.iterdir()] == ["episode.mcap.part"]


def test_an_empty_file_is_no_problem(tmp_path):
    (tmp_path / "episode.mcap.part").touch()
    assert [(recovery.status, recovery.detail) for recovery in recover(tmp_path)] == [("empty", "0 bytes")]


def _edited(path, old, new):
    content = path.read_bytes()
    assert content.count(old) == 1
    path.write_bytes(content.replace(old, new))


def test_metadata_that_is_not_what_was_written_is_refused(tmp_path, whole):
    """No check sum of the format covers metadata in a file without an end: the digest at the start does."""
    part = truncated(tmp_path / "episode.mcap.part", whole[0], 3)
    _edited(part, b"P01-a", b"P01-b")
    (recovery,) = recover(tmp_path)
    assert recovery.status == "damaged"
    assert recovery.detail == f"{part}: expected the metadata that was written at the start, found another"
    assert [entry.name for entry in tmp_path.iterdir()] == ["episode.mcap.part"]


def test_a_map_that_is_not_what_was_written_is_refused(tmp_path, whole):
    part = truncated(tmp_path / "episode.mcap.part", whole[0], 3)
    _edited(part, b'"obstacle_size": 50', b'"obstacle_size": 51')
    (recovery,) = recover(tmp_path)
    assert "expected the start of a recording of this task: metadata and map, found damage" in recovery.detail
    assert "an attachment that fails its check sum" in recovery.detail


def test_other_files_are_refused(tmp_path):
    part = tmp_path / "notes.mcap.part"
    part.write_bytes(b"not an MCAP file at all")
    with pytest.raises(FileFormatError, match="metadata and map, found a text file"):
        recover_file(part)
    with pytest.raises(FileFormatError, match="expected a folder of recordings, found no such file or folder"):
        recover(tmp_path / "none")


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


def test_damaged_finished_recordings_are_reported_and_only_on_request_recovered(tmp_path, whole):
    truth_path, truth = whole
    path = tmp_path / "episode.mcap"
    content = truth_path.read_bytes()
    path.write_bytes(content[:-20])
    assert recover(tmp_path) == []
    (recovery,) = recover(tmp_path, finished=True)
    assert (recovery.status, recovery.output) == ("damaged", None)
    assert recovery.detail.startswith(f"{path}: expected an intact and complete MCAP file")
    (recovery,) = recover(tmp_path, damaged=True)
    assert (recovery.status, recovery.steps) == ("recovered", 95)
    assert path.read_bytes() == content[:-20]
    episode = read_episode(tmp_path / "episode.recovered.mcap")
    assert episode.actions.tobytes() == truth.actions.tobytes()
    assert (episode.meta.success, episode.meta.termination_reason) == (False, "crash_recovered")


RECORDING = """
import sys, time
from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.dataset.episode import EpisodeMeta
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table import MAP_SETS

config = MAP_SETS["training"][6]
with EpisodeRecorder(sys.argv[1], config, EpisodeMeta("running")) as recording:
    for step in range(100):
        recording.step((0.1, 0.2, 0.3, 0.4), (*config.start, 0.0, 0.0, float(step)), 0.0)
    print("recorded", flush=True)
    sys.stdin.readline()
    recording.finish(True, "goal")
"""


def test_a_recording_that_runs_is_left_alone(tmp_path):
    path = tmp_path / "episode.mcap"
    process = subprocess.Popen(
        [sys.executable, "-c", RECORDING, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    with process:
        assert process.stdout.readline() == "recorded\n"
        (recovery,) = recover(tmp_path)
        assert (recovery.status, recovery.detail) == ("running", "another process is recording it")
        assert [entry.name for entry in tmp_path.iterdir()] == ["episode.mcap.part"]
        process.communicate("\n", timeout=60)
    assert len(read_episode(path).actions) == 100
    assert recover(tmp_path, finished=True) == []


def test_the_command_says_what_became_of_each_file(tmp_path, whole, capsys):
    truncated(tmp_path / "one.mcap.part", whole[0], 3)
    (tmp_path / "two.mcap.part").touch()
    assert main(["recover", str(tmp_path), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["recovered"], summary["damaged"]) == (1, 0)
    assert list(summary["files"]) == ["one.mcap.part", "two.mcap.part"]
    assert summary["files"]["one.mcap.part"].startswith("recovered as one.recovered.mcap, 53 steps: expected an intact")
    assert summary["files"]["two.mcap.part"] == "empty: 0 bytes"
    (tmp_path / "three.mcap").write_bytes(b"not an MCAP file at all")
    assert main(["recover", str(tmp_path)]) == 1
    printed = capsys.readouterr().out
    assert "already recovered as one.recovered.mcap, 53 steps" in printed
    assert "damaged: " in printed


def test_memory_hardly_grows_with_the_recording(tmp_path):
    peaks = {}
    for steps in (500, 3_000):
        path = tmp_path / f"{steps}.mcap"
        finished(path, steps)
        part = path.rename(f"{path}.part")
        tracemalloc.start()
        try:
            recover_file(part)
            _, peaks[steps] = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
    # Positions, rewards and timing of the steps stay, their messages do not.
    assert (peaks[3_000] - peaks[500]) / 2_500 < 1_000


def test_damaged_copies_give_an_error_of_ours_or_the_truth(tmp_path):
    """A sample of tests/benchmarks/damage.py."""
    counts = damage.study(96, 1, tmp_path)
    for verdicts in counts.values():
        assert set(verdicts) <= {"own error", "true prefix", "true whole"}
        assert sum(verdicts.values()) == 96
    assert counts["recover"]["true prefix"] > 30


def test_a_message_of_a_channel_that_was_lost_with_its_chunk_ends_the_episode(tmp_path, whole):
    """The first chunk declares the channels."""
    content = whole[0].read_bytes()
    begin, end = next(span for span in damage.record_spans(content) if content[span[0]] == 0x06)
    part = tmp_path / "episode.mcap.part"
    part.write_bytes(content[:begin] + content[end:])
    (recovery,) = recover(tmp_path)
    assert recovery.status == "damaged"
    assert "found a message of a channel 1 that was never declared" in recovery.detail


def test_the_study_sees_wrong_numbers_and_other_exceptions(tmp_path):
    sound, _ = damage.originals(tmp_path)
    truth = sound.truth
    changed = replace(truth, actions=-truth.actions)
    assert damage.verdict(sound, lambda: changed) == "WRONG NUMBERS"
    assert damage.verdict(sound, lambda: replace(truth, meta=replace(truth.meta, seed=38))) == "WRONG NUMBERS"
    assert damage.verdict(sound, lambda: [][0]) == "ANOTHER EXCEPTION: IndexError"
    assert damage.verdict(sound, lambda: truth) == "true whole"


def test_a_kill_costs_at_most_a_second_of_the_running_episode(tmp_path):
    """A sample of tests/benchmarks/kill.py."""
    kills = list(kill.study(3, 1, tmp_path, 0.5, 2.5, at_once=1))
    assert all(kill_result.handed > 0 for kill_result in kills)
    assert max(kill_result.lost for kill_result in kills) <= 30
    assert Counter((kill_result.touched, kill_result.unreadable) for kill_result in kills) == {(0, 0): 3}


def test_metadata_of_the_source_stays_in_order(tmp_path, whole):
    truncated(tmp_path / "episode.mcap.part", whole[0], 3)
    recover(tmp_path)
    with (tmp_path / "episode.recovered.mcap").open("rb") as file:
        names = [record.name for record in StreamReader(file).records if isinstance(record, Metadata)]
    assert names == [
        "session", "episode", "players", "devices", "software", "consent", "physics", "dataset_info",
        "episode_result", "recovery",
    ]  # fmt: skip
