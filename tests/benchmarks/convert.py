"""Time of `copolicy-convert mcap`, reading included, against LeRobot's add_frame / save_episode on the same frames.

    uv run python tests/benchmarks/convert.py --episodes 40

Imports are not counted; start-up of reading processes is. LeRobot's side gets frames that are ready in memory.
"""

import argparse
import contextlib
import importlib
import io
import logging
import os
import statistics
import tempfile
import time
import warnings
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ["HF_HUB_OFFLINE"] = "1"

import numpy as np

from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.convert.lerobot.frame_columns import frame_columns
from copolicy.convert.lerobot.prepare import Conversion
from copolicy.convert.recordings import convert_recordings
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.recording.reader import read_episode
from copolicy.tasks.table.features import FEATURES, TASK
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.world import TableWorld


def record(folder: Path, episodes: int, steps: int) -> None:
    """Recordings of smooth random forces, `steps` steps each."""
    rng = np.random.default_rng(0)
    folder.mkdir()
    for index in range(episodes):
        config = MAP_SETS["training"][index % len(MAP_SETS["training"])]
        world = TableWorld(config)
        actions = np.clip(np.cumsum(rng.normal(0, 0.2, (steps, 4)), axis=0), -1, 1)
        meta = EpisodeMeta(f"episode-{index:04d}", license="CC-BY-4.0")
        with EpisodeRecorder(folder / f"episode_{index:04d}.mcap", config, meta) as recorder:
            for action in actions:
                world.step(action)
                recorder.step(action, world.recorded, world.reward())
            recorder.finish(False, "unknown")


def lerobot_frames(folder: Path, fps: int) -> list[list[dict]]:
    """The frames of all recordings, as add_frame wants them."""
    episodes = []
    for path in sorted(folder.glob("*.mcap")):
        columns = frame_columns(read_episode(path), fps)
        shaped = {name: column.reshape(-1, *FEATURES[name]["shape"]) for name, column in columns.items()}
        frames = len(columns["next.done"])
        episodes.append([{"task": TASK, **{name: shaped[name][i] for name in shaped}} for i in range(frames)])
    return episodes


def write_by_lerobot(episodes: list[list[dict]], root: Path, fps: int) -> None:
    """The loop of LeRobot's documentation, its progress bars kept off the terminal."""
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    dataset = LeRobotDataset.create("local/benchmark", fps, FEATURES, root=root, use_videos=False)
    with contextlib.redirect_stderr(io.StringIO()):
        for frames in episodes:
            for frame in frames:
                dataset.add_frame(frame)
            dataset.save_episode()
        dataset.finalize()


def our_seconds(recordings: Path, root: Path, fps: int, workers: int) -> float:
    """Wall time of the conversion."""
    start = time.perf_counter()
    convert_recordings([recordings], root, "local/benchmark", Conversion(fps), workers=workers)
    return time.perf_counter() - start


def lerobot_seconds(recordings: Path, root: Path, fps: int) -> float:
    """Wall time of writing the same frames by LeRobot."""
    frames = lerobot_frames(recordings, fps)
    start = time.perf_counter()
    write_by_lerobot(frames, root, fps)
    return time.perf_counter() - start


def main() -> None:
    """Prints the ratios at 30 Hz and at 10 Hz."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=60)
    parser.add_argument("--steps", type=int, default=480, help="of 1/30 s in each (default: %(default)s)")
    parser.add_argument("--repeats", type=int, default=3, help="of our side; the median counts (default: %(default)s)")
    parser.add_argument("--workers", type=int, default=1, help="processes that read (default: %(default)s)")
    arguments = parser.parse_args()
    logging.disable(logging.WARNING)  # eighty lines about video codecs
    warnings.filterwarnings("ignore")
    importlib.import_module("lerobot.datasets.lerobot_dataset")
    importlib.import_module("copolicy.convert.lerobot.writer")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        recordings = folder / "recordings"
        record(recordings, arguments.episodes, arguments.steps)
        print(f"{arguments.episodes} episodes of {arguments.steps} steps, {arguments.workers} reading process(es)")
        for fps in (30, 10):
            repeats = [folder / f"copolicy-{fps}-{repeat}" for repeat in range(arguments.repeats)]
            ours = statistics.median(our_seconds(recordings, root, fps, arguments.workers) for root in repeats)
            theirs = lerobot_seconds(recordings, folder / f"lerobot-{fps}", fps)
            print(f"{fps:2d} Hz: {ours:.2f} s, add_frame / save_episode {theirs:.2f} s, ratio {theirs / ours:.1f}")


if __name__ == "__main__":
    main()
