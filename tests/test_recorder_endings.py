"""Recording: its one end, and the file after a recording that did not end with `finish`."""

import math
import re
import signal
import subprocess
import sys

import pytest
from mcap.exceptions import EndOfFile
from mcap.records import Message
from recorded_steps import ACTION, MAP, carry, recorder, records

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, OutputExistsError, RunError, ShapeError
from copolicy.dataset.recording.reader import read_episode, read_metadata


def test_nothing_is_overwritten(tmp_path):
    path = tmp_path / "episode.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(OutputExistsError, match=re.escape(f"{path}: expected a path that does not exist yet")):
        recorder(path).__enter__()
    assert path.read_bytes() == b"precious"
    path.unlink()
    part = tmp_path / "episode.mcap.part"
    part.write_bytes(b"what a crash left")
    with pytest.raises(OutputExistsError, match=re.escape(str(part))):
        recorder(path).__enter__()
    assert part.read_bytes() == b"what a crash left"


def test_a_name_taken_meanwhile_is_not_overwritten(tmp_path):
    path = tmp_path / "episode.mcap"
    with recorder(path) as recording:
        carry(recording, 3)
        path.write_bytes(b"precious")
        with pytest.raises(OutputExistsError):
            recording.finish(True, "goal")
    assert path.read_bytes() == b"precious"
    assert len(read_episode(tmp_path / "episode.mcap.part").actions) == 3


@pytest.mark.parametrize(
    ("error", "reason", "flags", "discarded"),
    [
        (ZeroDivisionError(), "crash_recovered", "aborted", False),
        (SystemExit(), "crash_recovered", "aborted", False),
        (KeyboardInterrupt(), "operator_discard", "", True),
        (None, "operator_discard", "", True),
    ],
)
def test_a_block_left_without_finish_is_complete_up_to_its_last_state(tmp_path, error, reason, flags, discarded):
    path = tmp_path / "episode.mcap"
    worlds = []

    def leave():
        with recorder(path) as recording:
            worlds.append(carry(recording, 40))
            if error is not None:
                raise error

    if error is None:
        leave()
    else:
        with pytest.raises(type(error)):
            leave()
    episode = read_episode(path)
    assert (episode.final_state == worlds[0].observation).all()
    assert len(episode.actions) == 40
    meta = episode.meta
    assert (meta.success, meta.termination_reason, meta.quality_flags, meta.discarded) == (
        False, reason, flags, discarded,
    )  # fmt: skip
    assert not (tmp_path / "episode.mcap.part").exists()


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        ({"action": (0.0, 0.0)}, ShapeError, "action: expected shape (4,), got (2,)"),
        (
            {"action": (0.0, 1.5, 0.0, 0.0)},
            InvalidValueError,
            "action: expected numbers in [-1, 1], found (0.0, 1.5, 0.0, 0.0)",
        ),
        ({"action": (math.nan, 0.0, 0.0, 0.0)}, InvalidValueError, "action: expected numbers in [-1, 1], found (nan"),
        (
            {"state": (1.0, math.inf, 0.0, 0.0, 0.0, 0.0)},
            InvalidValueError,
            "state: expected finite numbers, found (1.0, inf",
        ),
        ({"inputs": (object(), None)}, AttributeError, "'object' object has no attribute 'step'"),
    ],
)
def test_a_bad_step_leaves_no_trace(tmp_path, arguments, error, text):
    path = tmp_path / "episode.mcap"
    good = {"action": ACTION, "state": (*MAP.start, 0.0, 0.0, 0.0), "reward": 0.0}
    with recorder(path) as recording:
        recording.step(**good)
        with pytest.raises(error, match=re.escape(text)):
            recording.step(**{**good, **arguments})
        recording.step(**good)
        recording.finish(True, "goal")
    assert len(read_episode(path).actions) == 2


def test_one_end_and_nothing_after_it(tmp_path):
    path = tmp_path / "episode.mcap"
    with recorder(path) as recording:
        with pytest.raises(InvalidValueError, match="termination_reason: expected one of"):
            recording.finish(True, "done")
        recording.finish(True, "goal")
        with pytest.raises(RunError, match="expected one end of the recording, found another"):
            recording.finish(True, "goal")
        with pytest.raises(RunError, match="expected no step after the end of the recording, found one"):
            recording.step(ACTION, (*MAP.start, 0, 0, 0), 0.0)
    assert len(read_episode(path).actions) == 0


KILLED = """
import sys, time
from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.collect.recording.wall_clock import WallClockAnchor
from copolicy.dataset.episode import EpisodeMeta
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table import MAP_SETS

config = MAP_SETS["training"][6]
with EpisodeRecorder(sys.argv[1], config, EpisodeMeta("killed"), WallClockAnchor.simulated(0)) as recording:
    for step in range(100):
        recording.step((0.1, 0.2, 0.3, 0.4), (*config.start, 0.0, 0.0, float(step)), 0.0)
    print("recorded", flush=True)
    time.sleep(60)
"""


def test_a_killed_process_loses_at_most_a_second_of_its_part(tmp_path):
    path = tmp_path / "episode.mcap"
    process = subprocess.Popen([sys.executable, "-c", KILLED, str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    with process, process.stdout:
        assert process.stdout.readline() == "recorded\n"
        process.send_signal(signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
    assert [entry.name for entry in tmp_path.iterdir()] == ["episode.mcap.part"]
    part = tmp_path / "episode.mcap.part"
    with pytest.raises(FileFormatError, match="expected an intact and complete MCAP file, found its end at byte"):
        read_episode(part)
    assert read_metadata(part)["episode"]["episode_uuid"] == "killed"
    messages = []
    with pytest.raises(EndOfFile):
        messages.extend(records(part, Message))
    states = [record for record in messages if record.channel_id == 1]
    assert len(states) == 81
