"""Recovery of incomplete recordings: which files, what is refused, and nothing is deleted."""

import json
import re
import subprocess
import sys
import tracemalloc
from collections import Counter
from dataclasses import replace

import pytest
from benchmarks import damage, kill
from broken_recordings import finished, truncated

from copolicy.collect.cli import main
from copolicy.collect.recording.recover import recover, recover_file
from copolicy.dataset.exceptions import FileFormatError, OutputExistsError
from copolicy.dataset.recording.reader import read_episode


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "episode.mcap"
    return path, finished(path)


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
