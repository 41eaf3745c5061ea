"""A replay in Rerun, without the package: it is not among our dependencies (tried by hand with 0.41)."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

RERUN = """
import sys, types

LOGGED = []

class Stream:
    def __init__(self, application, recording_id=None):
        LOGGED.append(("stream", application))
    def save(self, path, default_blueprint=None):
        self.path = path
    def set_time(self, timeline, **value):
        LOGGED.append(("time", timeline, value))
    def log(self, entity, archetype, static=False):
        LOGGED.append(("log", entity, archetype, static))
    def flush(self):
        if len(sys.argv) > 3:
            raise RuntimeError(sys.argv[3])
        open(self.path, "w").write(repr(len(LOGGED)))
    def disconnect(self):
        pass

class Named(types.ModuleType):
    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *values, **named: (name, values, named)

rerun, blueprint = Named("rerun"), Named("rerun.blueprint")
rerun.RecordingStream = Stream
sys.modules["rerun"], sys.modules["rerun.blueprint"] = rerun, blueprint
from copolicy.collect.cli import main
status = main(["replay", sys.argv[1], "--out", sys.argv[2], "--json"])
if status:
    raise SystemExit(status)
from collections import Counter
import json
counts = Counter(entry[1] for entry in LOGGED if entry[0] == "log")
times = [entry[2]["duration"] for entry in LOGGED if entry[:2] == ("time", "sim_time")]
vectors = next(entry[2][2]["vectors"] for entry in LOGGED if entry[1] == "world/forces")
print(json.dumps([status, counts, times[:2] + times[-1:], vectors]))
"""


def test_rerun_gets_table_forces_and_interaction_on_the_timeline(recording, track, tmp_path):
    run = subprocess.run(
        [sys.executable, "-c", RERUN, str(recording), str(tmp_path / "a.rrd")],
        capture_output=True,
        text=True,
        check=True,
    )
    status, counts, times, vectors = json.loads(run.stdout.splitlines()[-1])
    assert status == 0
    assert counts == {
        "world/window": 1, "world/goal": 1, "world/obstacles": 1, "world/trail/robot": 1, "world/trail/human": 1,
        "about": 1, "interaction_force": track.steps + 1, "world/table": track.steps + 1,
        "world/forces": track.steps + 1, "events": 1,
    }  # fmt: skip
    assert times == pytest.approx([0.0, 1 / 30, track.steps / 30])
    assert np.array(vectors).ravel() == pytest.approx(95 * track.episode.actions[0])
    assert Path(tmp_path / "a.rrd").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["a.rrd"]


def test_a_file_that_rerun_cannot_write_is_one_line_and_is_not_left_half(recording, tmp_path):
    path = tmp_path / "a.rrd"
    run = subprocess.run(
        [sys.executable, "-c", RERUN, str(recording), str(path), "writer thread\nshut down"],
        capture_output=True,
        text=True,
    )
    expected = f"copolicy-collect: {path}: expected Rerun to write the file, found writer thread shut down\n"
    assert (run.returncode, run.stderr) == (1, expected)
    assert not list(tmp_path.iterdir())
