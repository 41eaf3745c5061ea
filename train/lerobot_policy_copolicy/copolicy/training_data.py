"""Checks of the training data by the co-policy itself, under any trainer that constructs it as LeRobot does.

`copolicy-train` makes the same checks before, for any policy; here they apply to `lerobot-train` and to training loops
of the user.
"""

import json
import logging
import math
from collections import Counter
from collections.abc import Collection
from dataclasses import asdict, replace
from typing import Any

from lerobot.datasets.streaming_dataset import StreamingLeRobotDataset

from copolicy.dataset.exceptions import InvalidValueError, RunError
from copolicy.dataset.task import PairTask, get_task
from copolicy.train.episode_choice import excluded_episodes, require_episode_columns
from copolicy.train.finite_data import mended_statistics, require_finite_frames
from copolicy.train.memory_training import CheckedStream

from ..env.configuration import PairTaskEnvConfig
from .callers import data_sets_of_callers, environment_of_callers
from .configuration_copolicy import CopolicyConfig

_PHYSICS = "physics"
_FREE = "step_limit"  # how long an episode may last is no property of the dynamics


def prepare_training(config: CopolicyConfig, meta: Any) -> frozenset[int]:
    """Checks the episodes that are trained on, and records their rate and physics in the configuration.

    Args:
        meta: LeRobot's metadata of the data set.

    Returns:
        Excluded episodes that must not come up in a batch; empty where it is known that they do not.

    Raises:
        RunError: an excluded episode would be trained on, the column that tells is gone, or a number is not finite.
    """
    data_sets = data_sets_of_callers(meta)
    excluded = excluded_episodes(meta)
    if not data_sets:
        require_episode_columns(meta, named=False)
        record_conditions(config, meta, None)
        return excluded
    chosen: set[int] = set()
    for data_set in data_sets:
        episodes = None if _yields_all(data_set) else data_set.episodes
        require_episode_columns(meta, named=episodes is not None)
        chosen |= set(range(meta.total_episodes) if episodes is None else episodes)
    used = sorted(excluded & chosen)
    if used:
        raise RunError(_refusal(meta, used, excluded, any(_yields_all(data_set) for data_set in data_sets)))
    require_finite_frames(meta.root, chosen, meta.features)
    mended_statistics(meta.root, meta.stats, chosen, meta.total_episodes)
    record_conditions(config, meta, chosen)
    return frozenset()


def record_conditions(config: CopolicyConfig, meta: Any, episodes: Collection[int] | None) -> None:
    """Writes the rate of the data, the physics of their episodes, and what of these no policy sees, into its settings.

    Args:
        episodes: that are trained on; None for all.
    """
    fps = float(meta.fps)
    if config.fps is not None and config.fps != fps:
        logging.warning("The policy was made for %g frames a second; it goes on with data of %g", config.fps, fps)
    config.fps = fps
    counts = _physics(meta, episodes)
    known = [text for text in counts if text]
    physics = json.loads(known[0]) if len(known) == 1 else None
    if physics is not None and config.physics is not None and config.physics != physics:
        logging.warning("The policy learned under other physics before: %s; these data: %s", config.physics, physics)
    config.physics = physics
    config.physics_mixture = dict(counts) if len(counts) > 1 else {}
    config.unseen = _unseen(get_task(config.filled.task), meta, episodes)
    if config.unseen:
        logging.warning("Of the episodes to train on, %s", config.unseen)
    if len(known) > 1:
        logging.warning(
            "The episodes were recorded under different physics, which the checkpoint records as a mixture: %s",
            "; ".join(f"{count} episodes {text or 'unknown'}" for text, count in counts.items()),
        )


def require_same_rate(config: CopolicyConfig) -> None:
    """Refuses an environment of another task, or one that plays actions at another rate than they were learned at.

    Says where its settings differ from those that the policy learned under, and what of its scenarios no policy sees.

    Raises:
        InvalidValueError: task or `--env.fps` differ from what the checkpoint records.
    """
    environment = environment_of_callers()
    if not isinstance(environment, PairTaskEnvConfig):
        return
    task = environment.pair_task
    if config.task != task.spec.name:
        raise InvalidValueError("--env.task", f"{config.task}, the task that the policy learned", task.spec.name)
    if config.fps is not None and environment.fps != config.fps:
        expected = f"{config.fps:g}, the frames a second of the data that the policy learned from"
        raise InvalidValueError("--env.fps", expected, environment.fps)
    settings = asdict(environment.physics)
    learned = {name: value for name, value in (config.physics or {}).items() if name in settings}
    if any(not math.isclose(value, settings[name]) for name, value in learned.items()):
        there = replace(environment.physics, **learned)
        words = task.settings_summary(there), task.settings_summary(environment.physics)
        logging.warning("The policy learned under %s; the environment has %s", *words)
    if unseen := task.unseen_summary([task.columns_of(scenario) for scenario in environment.scenarios]):
        logging.warning("Of the maps of the environment, %s", unseen)


def _unseen(task: PairTask, meta: Any, episodes: Collection[int] | None) -> str:
    """See `PairTask.unseen_summary`."""
    scenario = next(iter(scenarios[0] for scenarios in task.scenario_sets.values() if scenarios), None)
    table = meta.episodes
    names = [name for name in task.columns_of(scenario) if name in table.column_names] if table and scenario else []
    if not names:
        return ""
    numbers, rows = table["episode_index"], zip(*(table[name] for name in names), strict=True)
    chosen = [
        dict(zip(names, row, strict=True))
        for episode, row in zip(numbers, rows, strict=True)
        if episodes is None or episode in episodes
    ]
    return task.unseen_summary(chosen)


def _physics(meta: Any, episodes: Collection[int] | None) -> Counter[str]:
    """How many episodes have which physics, as JSON without the time limit; an empty text where it is not known."""
    table = meta.episodes
    if table is None or _PHYSICS not in table.column_names:
        return Counter()
    counts: Counter[str] = Counter()
    for episode, text in zip(table["episode_index"], table[_PHYSICS], strict=True):
        if episodes is None or episode in episodes:
            counts[_dynamics(text)] += 1
    return counts


def _dynamics(text: str | None) -> str:
    try:
        settings = json.loads(text or "{}")
        return (
            json.dumps({name: float(settings[name]) for name in sorted(settings) if name != _FREE}) if settings else ""
        )
    except (ValueError, TypeError, AttributeError):
        raise RunError(f"meta/episodes: expected the settings of the physics as JSON, found {text!r}") from None


def _yields_all(data_set: Any) -> bool:
    """LeRobot's streamed data set yields every episode, whichever were asked for."""
    return isinstance(data_set, StreamingLeRobotDataset) and not isinstance(data_set, CheckedStream)


def _refusal(meta: Any, used: list[int], excluded: frozenset[int], streamed: bool) -> str:
    text = f"{meta.root}: expected no excluded episode among those to train on, found {used}; train with copolicy-train"
    if streamed:
        return f"{text}, since LeRobot's streamed data set yields every episode"
    rest = ",".join(str(episode) for episode in range(meta.total_episodes) if episode not in excluded)
    return f"{text}, which leaves them out, or give --dataset.episodes=[{rest}]"
