"""Records episodes of scripted pairs in parallel, in simulated time."""

import contextlib
import ctypes
import multiprocessing
import os
import time
import uuid
from collections import Counter, defaultdict
from collections.abc import Hashable, Iterable, Iterator, Sequence
from concurrent.futures import as_completed
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.exceptions import InvalidValueError, OutputExistsError
from copolicy.dataset.files.listing import is_hidden
from copolicy.dataset.scenarios import DISPLACED
from copolicy.dataset.task import TABLE, PairTask, get_task
from copolicy.dataset.worker_pool import WorkerPool

from ..agents.simulated_players import pair_name, simulated_players
from ..recording.episode_file import PART_SUFFIX
from ..recording.wall_clock import WallClockAnchor
from .episode_job import EpisodeJob, RecordedEpisode
from .schedule import balanced_schedule


def simulate(
    out: Path | str,
    episodes: int,
    seed: int,
    map_set: str | None = None,
    workers: int | None = None,
    orientations: bool = False,
    pairs: Sequence[str] | None = None,
    settings: Any = None,
    started_ns: int | None = None,
    start_noise: float = 0.0,
    clearance: float | None = None,
    task: str = TABLE,
) -> dict[str, Any]:
    """Records `episode_000000.mcap`, ... of scripted pairs over a set of maps into a folder.

    States and actions depend only on the seed, the set and the pairs, not on the number of workers or the load: each
    episode draws from `SeedSequence((seed, index))`. Failures and time-outs are recorded too, with their outcome.

    Args:
        out: the folder; made if missing.
        episodes: number of episodes.
        seed: of the schedule and of the players.
        map_set: name of a set of maps, a map file, or one of its splits as `FILE#split`; by default the task's first
            set.
        workers: processes; by default one for each processor.
        orientations: use each map with four start orientations.
        pairs: names of simulated pairs; by default `SimulatedPlayers.default_pairs`.
        settings: of the world; the task's default if None.
        started_ns: start time in the recordings, UTC, nanoseconds since 1970; by default now. With a fixed time,
            equal calls write equal bytes.
        start_noise: scale of the random displacement of the start, see `PairTask.displaced`; 0 for none.
        clearance: factor on the distance that both players keep from obstacles, instead of that of their profiles.
        task: name of the task.

    Returns:
        Counts and rates, JSON-able.

    Raises:
        OutputExistsError: the folder has recordings already, or is a file; nothing was written.
        UnknownNameError: no such task, map set or pair.
        FileFormatError: a map file that cannot be used.
        InvalidValueError: less than one episode or worker, a negative seed, or an option that the task lacks.
        CopolicyError: the task has no simulated players.
        OSError: a write failed; all recordings of this call were removed.
    """
    out = Path(out)
    workers = _processors() if workers is None else workers
    minima = {"episodes": (episodes, 1), "workers": (workers, 1), "seed": (seed, 0), "start_noise": (start_noise, 0)}
    for name, (value, minimum) in minima.items():
        if value < minimum:
            raise InvalidValueError(name, f"at least {minimum}", value)
    pair_task = get_task(task)
    players = simulated_players(pair_task)
    if clearance is not None and "clearance" not in players.options:
        raise InvalidValueError("--clearance", "no such flag", pair_task.missing("clearance of simulated players"))
    scenario_set = pair_task.scenario_set(map_set or next(iter(pair_task.scenario_sets)))
    scenarios = (pair_task.turned(scenario_set) if orientations else scenario_set).scheduled
    default = players.default_pairs or tuple(players.pairs)
    pairs = default if pairs is None else tuple(pair_name(pair_task, pair, "pair") for pair in pairs)
    _refuse_recordings(out)

    anchor = WallClockAnchor.simulated(time.time_ns() if started_ns is None else started_ns)
    # The digest distinguishes the sets of map files with equal names.
    variant = scenario_set.label.replace("#", ".") + f"-{scenario_set.digest}" * scenario_set.from_file
    variant = variant if task == TABLE else f"{task}-{variant}"
    variant += f"{'-orientations' if orientations else ''}"
    variant += f"-start_noise_{start_noise:g}" * (start_noise != 0)
    variant += "" if clearance is None else f"-clearance_{clearance:g}"
    settings = settings or pair_task.settings_type()
    options = {} if clearance is None else {"clearance": clearance}
    jobs = []
    for index, (scenario_index, pair) in enumerate(balanced_schedule(len(scenarios), pairs, episodes, seed)):
        scenario = scenarios[scenario_index]
        meta = _meta(pair_task, scenario, pair, variant, seed, index)
        if start_noise:
            scenario = pair_task.displaced(scenario, start_noise, np.random.default_rng((seed, index)))
            meta = replace(meta, map_id=meta.map_id + DISPLACED)
        jobs.append(EpisodeJob(out / f"episode_{index:06d}.mcap", task, scenario, settings, meta, anchor, options))
    new = not out.exists()
    out.mkdir(parents=True, exist_ok=True)
    started = time.perf_counter()
    try:
        results = list(progress(_record_all(jobs, workers), len(jobs), "episodes"))
    except OSError:
        _remove(jobs, out if new else None)
        raise
    return _summary(out, results, time.perf_counter() - started)


def _meta(task: PairTask, scenario: Any, pair: str, variant: str, seed: int, index: int) -> EpisodeMeta:
    software = version("lerobot_policy_copolicy")
    return EpisodeMeta(
        episode_uuid=str(uuid.uuid5(uuid.NAMESPACE_OID, f"copolicy {software} {variant} {pair} {seed} {index}")),
        session_id=f"simulated-{variant}-{seed}",
        pair_id=pair,
        player_0_id=f"{pair}-robot",
        player_1_id=f"{pair}-human",
        controller_0="scripted",
        controller_1="scripted",
        **task.name_of(scenario).columns,
        seed=int(np.random.SeedSequence((seed, index)).generate_state(1)[0]),
        source="simulated",
        software_version=software,
    )


def _record_all(jobs: list[EpisodeJob], workers: int) -> Iterator[RecordedEpisode]:
    groups = _groups_by_layout(jobs, workers)
    if workers == 1 or len(groups) == 1:
        for group in groups:
            for job in group:
                yield job.record()
        return
    # Without a lock, which a killed worker would never release.
    stop = multiprocessing.get_context("spawn").RawValue(ctypes.c_bool, False)
    with WorkerPool(min(workers, len(groups)), _set_stop, (stop,)) as pool:
        futures = [pool.submit(_record_group, group) for group in groups]
        try:
            for future in as_completed(futures):
                yield from future.result()
        except BaseException:
            stop.value = True
            raise


def _groups_by_layout(jobs: Iterable[EpisodeJob], workers: int) -> list[list[EpisodeJob]]:
    """Groups episodes with the same goal and obstacles, whose routes are slow to compute and cached in a process."""
    by_layout: dict[Hashable, list[EpisodeJob]] = defaultdict(list)
    for job in jobs:
        by_layout[get_task(job.task).layout(job.scenario, with_goal=True)].append(job)
    parts = -(-workers // len(by_layout))
    return [group[part::parts] for group in by_layout.values() for part in range(min(parts, len(group)))]


_stop: ctypes.c_bool | None = None  # in a worker process; true once the command is stopped


def _set_stop(stop: ctypes.c_bool) -> None:
    global _stop
    _stop = stop


def _record_group(jobs: list[EpisodeJob]) -> list[RecordedEpisode]:
    return [job.record() for job in jobs if _stop is None or not _stop.value]


def _remove(jobs: list[EpisodeJob], folder: Path | None) -> None:
    """Deletes the recordings of a call that failed, since the same call can make them again."""
    for job in jobs:
        for path in (job.path, job.path.with_name(job.path.name + PART_SUFFIX)):
            path.unlink(missing_ok=True)
    if folder is not None:
        with contextlib.suppress(OSError):
            folder.rmdir()


def _refuse_recordings(out: Path) -> None:
    if out.exists() and not out.is_dir():
        raise OutputExistsError(out)
    for pattern in ("*.mcap", f"*.mcap{PART_SUFFIX}"):
        for path in sorted(path for path in out.glob(pattern) if not is_hidden(path.name)):
            raise OutputExistsError(path)


def _summary(out: Path, results: list[RecordedEpisode], seconds: float) -> dict[str, Any]:
    steps = sum(result.steps for result in results)
    size = sum(result.size for result in results)
    return {
        "out": str(out),
        "episodes": len(results),
        "success_rate": sum(result.success for result in results) / len(results),
        "termination_reasons": dict(sorted(Counter(result.termination_reason for result in results).items())),
        "steps": steps,
        "bytes": size,
        "seconds": round(seconds, 3),
        "steps_per_second": round(steps / seconds, 1),
    }


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
