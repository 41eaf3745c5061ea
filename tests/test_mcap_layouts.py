"""One rule for all readers: what the MCAP specification allows is read, and what carries no check sum is named."""

import contextlib
import io
import json
import struct
import tracemalloc
from dataclasses import replace

import mcap_variants as variants
import numpy as np
import pytest
import zstandard
from mcap.records import Channel, Message, Metadata, Schema
from scripted_agents import scripted_agents

from copolicy.collect.agents import ReplayAgent
from copolicy.collect.cli import main as collect
from copolicy.collect.recording.recover import recover, recover_file
from copolicy.collect.recording.wall_clock import WallClockAnchor
from copolicy.collect.replay.track import read_track
from copolicy.collect.session import iter_recordings
from copolicy.collect.simulate.episode_job import record_episode
from copolicy.convert.cli import main as convert
from copolicy.dataset.checks.checking import check_dataset
from copolicy.dataset.cli import main as dataset
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.exceptions import FileFormatError, ForeignRecordingError
from copolicy.dataset.recording.mcap_chunks import LARGEST_CHUNK, chunk_records
from copolicy.dataset.recording.reader import read_episode, read_metadata, read_recording
from copolicy.dataset.transfer.raw_recordings import find_raw_recordings
from copolicy.evaluate.human_study.recordings import study_rows
from copolicy.tasks.table.maps import MAP_SETS

LAYOUTS = {**{name: (variant, ()) for name, variant in variants.VERIFIED.items()}, **variants.UNVERIFIED}


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """A recording of a scripted pair and its episode."""
    path = tmp_path_factory.mktemp("source") / "episode_000.mcap"
    config = MAP_SETS["training"][6]
    meta = EpisodeMeta("layouts", "s-1", "S01", "S01-a", "S01-b", map_id="training-06", map_set="training", seed=37)
    record_episode(path, config, scripted_agents(3), meta, WallClockAnchor.simulated(10**18))
    return path, read_recording(path)


def run(main, *arguments):
    """Exit status, JSON summary, lines on stderr."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main([*map(str, arguments), "--json"])
    return status, json.loads(out.getvalue() or "null"), err.getvalue().splitlines()


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_reader_takes_every_layout(source, tmp_path, name):
    path, truth = source
    variant, expected = LAYOUTS[name]
    folder = tmp_path / "recordings"
    folder.mkdir()
    file = folder / "episode_000.mcap"
    variant(path, file)

    def said(notes):
        assert len(notes) == len(expected), notes
        assert all(part in note and "used as" in note for note, part in zip(notes, expected, strict=True))
        return True

    recording = read_recording(file)
    episode = recording.episode
    assert episode.states.tobytes() == truth.episode.states.tobytes()
    assert episode.actions.tobytes() == truth.episode.actions.tobytes()
    assert episode.final_state.tobytes() == truth.episode.final_state.tobytes()
    same = {"source_sha256": "", "replay_drift_px": 0.0, "achieved_hz": 0.0}
    assert replace(episode.meta, **same) == replace(truth.episode.meta, **same)
    assert episode.map_config == truth.episode.map_config
    assert [event.kind for event in recording.events] == [event.kind for event in truth.events]
    assert said(episode.notes)

    assert {key: value for key, value in read_metadata(file).items() if key != "calibration"} == read_metadata(path)
    assert [(one.map_id, one.counts) for one in iter_recordings(folder)] == [("training-06", True)]
    assert np.array_equal(ReplayAgent(file)._actions[0], truth.episode.actions)
    assert read_track(file).events == read_track(path).events

    status, summary, lines = run(collect, "replay", file, "--verify", "--out", tmp_path / "sheet.png")
    assert (status, summary["verify"]["reproduced"], lines) == (0, True, [])
    assert said(summary["verify"]["not_verified"])
    status, summary, lines = run(collect, "recover", folder)
    assert (status, summary["recovered"], summary["damaged"], summary["files"]) == (0, 0, 0, {})

    status, _, lines = run(dataset, "check", folder)
    assert (status, lines) == (0, [])
    findings = [one for one in check_dataset(folder).findings if one.rule == "not_verified"]
    assert {finding.severity for finding in findings} <= {"warning"}
    assert said([finding.message for finding in findings])

    root = tmp_path / "set"
    status, summary, lines = run(convert, "mcap", folder, "--out", root, "--repo-id", "lab/x", "--keep-discarded")
    assert (status, summary["episodes"], lines) == (0, 1, [])
    assert said([note.removeprefix("episode layouts: ") for note in summary["not_verified"]])
    notes = json.loads((root / "meta" / "copolicy.json").read_text(encoding="utf-8"))["notes"]
    assert notes == ({"layouts": list(episode.notes)} if expected else {})
    assert list(find_raw_recordings(root, folder).files) == ["raw/episode_000.mcap"]
    (row,), left_out = study_rows([folder], None)
    assert (row["steps"], left_out) == (len(truth.episode.actions), {})


@pytest.mark.parametrize("name", ["zstd", "lz4", "unchunked", "filtered", "no sums", "unchunked, no sums"])
def test_what_broke_off_is_recovered_in_other_layouts_too(source, tmp_path, name):
    path, truth = source
    variant, expected = LAYOUTS[name]
    whole, part = tmp_path / "whole", tmp_path / "episode.mcap.part"
    variant(path, whole)
    content = whole.read_bytes()
    end = next(body for opcode, body in variants.byte_records(content) if opcode == variants.DATA_END)
    part.write_bytes(content[: content.index(struct.pack("<BQ", variants.DATA_END, 4) + end)])
    recovery = recover_file(part)
    assert recovery.status == "recovered"
    assert recovery.steps == len(truth.episode.actions)
    assert recovery.output is not None
    episode = read_episode(recovery.output)
    assert episode.actions.tobytes() == truth.episode.actions.tobytes()
    # The recovered file has check sums of its own, which do not vouch for its source.
    notes = [note for note in expected if "data section" not in note]
    if name == "unchunked":  # the check sum over its data was lost with its end
        notes = ["messages outside of chunks carry no check sum"]
    assert len(episode.notes) == len(notes)
    assert all(part in note for note, part in zip(episode.notes, notes, strict=True))
    assert all(part in recovery.detail for part in notes)


def refusal(path, kind=FileFormatError):
    with pytest.raises(kind) as caught:
        read_episode(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: expected ")
    assert "\n" not in message
    return message.removeprefix(f"{path}: ")


@pytest.mark.parametrize("options", [{}, {"enable_crcs": False, "use_chunking": False}, variants.NO_INDEX])
def test_another_projects_file_is_named_as_such(source, tmp_path, options, caplog):
    folder = tmp_path / "recordings"
    folder.mkdir()
    file = folder / "arm.mcap"
    variants.write(variants.camera(), file, enable_data_crcs=False, **options)
    found = "no recording of this task (channels: /camera, /episode/event, /joint_states)"
    expected = f"expected a recording of this task, found {found}"
    assert refusal(file, ForeignRecordingError) == expected
    line = f"{file}: {expected}"
    assert run(collect, "replay", file, "--verify") == (2, None, [f"copolicy-collect: {line}"])
    status, summary, _ = run(collect, "recover", folder)
    assert (status, summary["files"]) == (0, {"arm.mcap": f"foreign: {expected}"})
    part = tmp_path / "arm.mcap.part"
    part.write_bytes(file.read_bytes()[:-8])
    assert [(one.status, one.detail) for one in recover(tmp_path)] == [("foreign", expected)]
    status, document, _ = run(dataset, "check", folder)
    assert status == 1
    assert [(one["rule"], one["message"]) for one in document["findings"]] == [("foreign", expected)]
    status, _, lines = run(convert, "mcap", folder, "--out", tmp_path / "set", "--repo-id", "lab/x")
    skip = "nothing was written (--skip-damaged skips such files)"
    assert (status, lines) == (1, [f"copolicy-convert: {line}; {skip}"])
    assert list(iter_recordings(folder)) == []
    assert "not counted: " in caplog.text
    assert "expected a recording of this task, found no metadata entry" in caplog.text


def test_large_or_unknown_chunks_of_another_project_do_not_hide_whose_they_are(tmp_path):
    file = tmp_path / "arm.mcap"
    schema_and_channel = b"".join(
        struct.pack("<BQ", opcode, len(body)) + body
        for opcode, body in ((4, struct.pack("<HHI", 1, 0, 7) + b"/camera" + struct.pack("<III", 0, 0, 0)),)
    )
    snappy = bytes(16) + struct.pack("<QII", 10, 0, 6) + b"snappy" + struct.pack("<Q", 3) + b"abc"
    header = (1, struct.pack("<II", 0, 0))
    channel = (4, schema_and_channel[9:])
    variants.write_bytes([header, channel, (6, snappy)], file, data_crc=False)
    assert "no recording of this task (channels: /camera)" in refusal(file, ForeignRecordingError)


def test_a_later_schema_version_is_named_as_such(source, tmp_path, caplog):
    """Whatever else the later version changed."""
    records = []
    for record in variants.library_records(source[0]):
        if isinstance(record, Metadata) and record.name == "dataset_info":
            record.metadata["schema_version"] = "2"
        if isinstance(record, Metadata) and record.name == "players":
            continue
        if isinstance(record, Schema):
            record.name = record.name.replace("copolicy.v1", "copolicy.v2")
        records.append(record)
    variants.write(records, tmp_path / "later.mcap", enable_data_crcs=False)
    assert refusal(tmp_path / "later.mcap", ForeignRecordingError) == (
        "expected a recording of schema version 1, the latest supported, found schema version '2' (update copolicy)"
    )
    assert list(iter_recordings(tmp_path)) == []
    assert "found schema version '2'" in caplog.text


def changed(source, target, change, **options):
    records = variants.library_records(source)
    change(records)
    variants.write(records, target, enable_crcs=False, enable_data_crcs=False, **options)


def first_message(records, topic):
    channel = next(record.id for record in records if isinstance(record, Channel) and record.topic == topic)
    return next(r for r in records if isinstance(r, Message) and r.channel_id == channel)


def test_files_without_check_sums_are_held_against_all_else_that_they_say(source, tmp_path):
    path, _ = source
    file = tmp_path / "file.mcap"
    changed(path, file, lambda records: records.remove(first_message(records, "/player/0/action")))
    assert "messages" in refusal(file)
    changed(path, file, lambda records: records.append(first_message(records, "/table/state")))
    assert "states of" in refusal(file)

    def rename(records):
        next(r for r in records if isinstance(r, Metadata) and r.name == "players").metadata["pair_id"] = "S02"

    changed(path, file, rename)
    assert refusal(file) == "expected the metadata that was written at the start, found another"
    changed(path, file, lambda records: None)
    content = file.read_bytes()
    (statistics,) = [body for opcode, body in variants.byte_records(content) if opcode == 11]
    (messages,) = struct.unpack_from("<Q", statistics)
    file.write_bytes(content.replace(statistics, struct.pack("<Q", messages + 1) + statistics[8:]))
    assert refusal(file) == f"expected {messages + 1} messages, as its summary counts, found {messages}"


def test_check_sums_that_are_there_are_verified_without_one_over_all(source, tmp_path):
    path, _ = source
    sections = variants.data_section(path)
    file = tmp_path / "file.mcap"
    for opcode, where in ((variants.CHUNK, 26), (variants.ATTACHMENT, -10)):
        index = next(i for i, (kind, _) in enumerate(sections) if kind == opcode)
        body = bytearray(sections[index][1])
        body[where] ^= 1
        variants.write_bytes([*sections[:index], (opcode, bytes(body)), *sections[index + 1 :]], file, data_crc=False)
        assert "that fails its check sum" in refusal(file)


def test_records_that_leave_their_chunk_and_records_of_no_kind_are_refused(source, tmp_path):
    sections = variants.data_section(source[0])
    file = tmp_path / "file.mcap"
    index = next(i for i, (kind, _) in enumerate(sections) if kind == variants.CHUNK)
    content = variants.chunk_content(sections[index][1])
    for wrong, found in (
        (content[:-1], "a record that leaves its chunk"),
        (content + b"\5", "a record that leaves its chunk"),
        (content + struct.pack("<BQ", 5, 3) + b"abc", "a message of 3 bytes"),
    ):
        body = variants.chunk(sections[index][1], "", lambda _, wrong=wrong: wrong, crc=False, size=len(wrong))
        variants.write_bytes([*sections[:index], (6, body), *sections[index + 1 :]], file, data_crc=True)
        assert found in refusal(file)
    variants.write_bytes([*sections, (0, b"")], file, data_crc=True)
    assert "a record without a kind" in refusal(file)


def test_a_chunk_that_inflates_beyond_its_head_takes_no_memory(source):
    (body,) = [body for opcode, body in variants.data_section(source[0]) if opcode == variants.CHUNK][:1]
    bomb = zstandard.ZstdCompressor(write_content_size=False).compress(bytes(512 << 20))
    packed = variants.lz4_stream(bytes(256 << 20))
    for compression, stored in (("zstd", bomb), ("lz4", packed)):
        told = variants.chunk(body, compression, lambda _, stored=stored: stored, crc=False, size=1 << 20)
        tracemalloc.start()
        try:
            with pytest.raises(ValueError, match="whose size contradicts its header"):
                chunk_records(told)
            assert tracemalloc.get_traced_memory()[1] < 32 << 20
        finally:
            tracemalloc.stop()
        larger = variants.chunk(body, compression, lambda _, stored=stored: stored, size=LARGEST_CHUNK + 1)
        with pytest.raises(ValueError, match=f"a chunk of {LARGEST_CHUNK + 1} bytes"):
            chunk_records(larger)
