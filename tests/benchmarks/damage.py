"""Damaged recordings through `read_episode` and `recover`: our own error, the truth or its beginning, nothing else.

uv run python tests/benchmarks/damage.py --copies 1200
"""

import argparse
import struct
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scripted_agents import scripted_agents

from copolicy.collect.recording.recover import recover_file
from copolicy.collect.recording.wall_clock import WallClockAnchor
from copolicy.collect.simulate.episode_job import record_episode
from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.episode import Episode, EpisodeMeta
from copolicy.dataset.exceptions import CopolicyError
from copolicy.dataset.recording.reader import read_episode
from copolicy.tasks.table.maps import MAP_SETS

RESULT_COLUMNS = (
    "success", "termination_reason", "duration_s", "route_class", "quality_flags", "source_sha256", "replay_drift_px",
    "achieved_hz", "late_ticks",
)  # fmt: skip
"""What may differ between an episode and its recovered beginning."""

Damage = Callable[[bytearray, np.random.Generator], None]


def flip_bits(content: bytearray, rng: np.random.Generator) -> None:
    """One to eight single bits."""
    for place in rng.integers(len(content), size=int(rng.integers(1, 9))):
        content[place] ^= 1 << int(rng.integers(8))


def zero_range(content: bytearray, rng: np.random.Generator) -> None:
    """Up to 4 KiB of zeros, as a file system leaves them after a power failure."""
    begin, length = int(rng.integers(len(content))), int(rng.integers(1, 4096))
    content[begin : begin + length] = bytes(len(content[begin : begin + length]))


def truncate(content: bytearray, rng: np.random.Generator) -> None:
    """Cut anywhere."""
    del content[int(rng.integers(len(content))) :]


def append_garbage(content: bytearray, rng: np.random.Generator) -> None:
    """Random bytes at the end."""
    content += rng.bytes(int(rng.integers(1, 4096)))


def remove_range(content: bytearray, rng: np.random.Generator) -> None:
    """Bytes missing in the middle."""
    begin = int(rng.integers(len(content)))
    del content[begin : begin + int(rng.integers(1, 4096))]


def swap_chunks(content: bytearray, rng: np.random.Generator) -> None:
    """Two records of the file, chunks among them, in each other's place."""
    spans = record_spans(bytes(content))
    first, second = sorted(rng.choice(len(spans), 2, replace=False))
    (a, b), (c, d) = spans[first], spans[second]
    content[a:d] = content[c:d] + content[b:c] + content[a:b]


def repeat_chunk(content: bytearray, rng: np.random.Generator) -> None:
    """A record of the file once more, right after itself."""
    spans = record_spans(bytes(content))
    begin, end = spans[int(rng.integers(len(spans)))]
    content[end:end] = content[begin:end]


def remove_chunk(content: bytearray, rng: np.random.Generator) -> None:
    """A record of the file missing."""
    spans = record_spans(bytes(content))
    begin, end = spans[int(rng.integers(len(spans)))]
    del content[begin:end]


DAMAGES: tuple[Damage, ...] = (
    flip_bits, zero_range, truncate, append_garbage, remove_range, swap_chunks, repeat_chunk, remove_chunk,
)  # fmt: skip


def record_spans(content: bytes) -> list[tuple[int, int]]:
    """Begin and end of every record of an MCAP file."""
    spans, position = [], 8
    while position + 9 <= len(content) - 8:
        (length,) = struct.unpack_from("<Q", content, position + 1)
        spans.append((position, position + 9 + length))
        position += 9 + length
    return spans


@dataclass(frozen=True)
class Original:
    """A sound recording and what it holds: finished, or broken off somewhere."""

    content: bytes
    finished: bool
    truth: Episode


def originals(folder: Path) -> list[Original]:
    """A finished recording of a simulated pair, and the `.part` that a kill before its end would have left."""
    config = MAP_SETS["training"][6]
    path = folder / "truth.mcap"
    record_episode(
        path, config, scripted_agents(3), EpisodeMeta("truth", pair_id="S01", seed=37),
        WallClockAnchor.simulated(10**18),
    )  # fmt: skip
    content, truth = path.read_bytes(), read_episode(path)
    path.unlink()
    # The last chunk of the file and all that follows it were still in memory.
    last_chunk = [begin for begin, _ in record_spans(content) if content[begin] == 0x06][-1]
    return [Original(content, True, truth), Original(content[:last_chunk], False, truth)]


def damage_once(original: Original, damage: Damage, rng: np.random.Generator, folder: Path) -> tuple[str, str]:
    """What became of one damaged copy in `read_episode` and in `recover`.

    Returns:
        Each one of `own error`, `true prefix`, `true whole`, or what else happened.
    """
    content = bytearray(original.content)
    damage(content, rng)
    source = folder / ("copy.mcap" if original.finished else "copy.mcap.part")
    source.write_bytes(content)
    verdicts = verdict(original, lambda: read_episode(source)), verdict(original, lambda: _recovered(source))
    for path in folder.iterdir():
        path.unlink()
    return verdicts


def verdict(original: Original, read: Callable[[], Episode]) -> str:
    """How what was read compares with the truth."""
    try:
        episode = read()
    except CopolicyError:
        return "own error"
    except Exception as error:
        return f"ANOTHER EXCEPTION: {type(error).__name__}"
    truth, steps = original.truth, len(episode.actions)
    states = np.vstack((truth.states, truth.final_state))
    same = (
        np.vstack((episode.states, episode.final_state)).tobytes() == states[: steps + 1].tobytes()
        and episode.actions.tobytes() == truth.actions[:steps].tobytes()
        and episode.map_config == truth.map_config
        and _who(episode) == _who(truth)
    )
    if not same:
        return "WRONG NUMBERS"
    return "true whole" if steps == len(truth.actions) else "true prefix"


def _who(episode: Episode) -> EpisodeMeta:
    blank = EpisodeMeta("")
    return replace(episode.meta, **{name: getattr(blank, name) for name in RESULT_COLUMNS})


def _recovered(source: Path) -> Episode:
    before = source.read_bytes()
    recovery = recover_file(source)
    if source.read_bytes() != before:
        raise AssertionError("the source was changed")
    if recovery.output is None:
        raise CopolicyError(recovery.detail)
    return read_episode(recovery.output)


def study(copies: int, seed: int, folder: Path) -> dict[str, Counter[str]]:
    """Verdicts of `read_episode` and `recover` over damaged copies, the kinds of damage in turn."""
    rng = np.random.default_rng(seed)
    sources = originals(folder)
    counts: dict[str, Counter[str]] = {"read_episode": Counter(), "recover": Counter()}
    for index in progress(range(copies), copies, "damaged copies"):
        original = sources[index % 2]
        damage = DAMAGES[index // 2 % len(DAMAGES)]
        for reader, found in zip(counts, damage_once(original, damage, rng, folder), strict=True):
            counts[reader][found] += 1
    return counts


def main() -> int:
    """Prints the counts; exit status 1 where anything but an error of ours or the truth came out."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--copies", type=int, default=1200)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        counts = study(arguments.copies, arguments.seed, Path(folder))
    allowed = {"own error", "true prefix", "true whole"}
    for reader, verdicts in counts.items():
        print(f"{reader:<13}", ", ".join(f"{found}: {count}" for found, count in sorted(verdicts.items())))
    return int(any(set(verdicts) - allowed for verdicts in counts.values()))


if __name__ == "__main__":
    sys.exit(main())
