"""Recordings of the table, whole and broken off."""

import numpy as np
from benchmarks import damage

from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.collect.recording.wall_clock import WallClockAnchor
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.recording.messages.copolicy_pb2 import LoopTiming, PlayerInput
from copolicy.dataset.recording.reader import read_episode
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
