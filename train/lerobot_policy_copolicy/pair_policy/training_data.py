"""Checks of the training data in the co-policy's constructor, for `lerobot-train` and other trainers.

`copolicy-train` makes the same checks earlier, for any policy.
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
from copolicy.train.finite_data import replacement_statistics, require_finite_frames
from copolicy.train.memory_training import CheckedStream

from ..env.configuration import PairTaskEnvConfig
from .callers import data_sets_of_callers, environment_of_callers
from .configuration_pair import PairPolicyConfig

_PHYSICS = "physics"
_PUBLISHED_FPS = 30  # see PairPolicyConfig.frames_at_30_hz
_STEP_LIMIT = "step_limit"  # not compared: no property of the dynamics


def prepare_training(config: PairPolicyConfig, meta: Any) -> frozenset[int]:
    """Checks the episodes to train on, and records their rate and world settings in the configuration.

    Args:
        meta: LeRobot's metadata of the data set.

    Returns:
        Excluded episodes to refuse in batches; empty if the episodes of the training are known and have none.

    Raises:
        RunError: an excluded episode would be trained on, the column of excluded episodes is lost, or a number is not
            finite.
    """
    data_sets = data_sets_of_callers(meta)
    excluded = excluded_episodes(meta)
    if not data_sets:
        require_episode_columns(meta, requested=False)
        record_conditions(config, meta, None)
        return excluded
    chosen: set[int] = set()
    for data_set in data_sets:
        episodes = None if _yields_all(data_set) else data_set.episodes
        require_episode_columns(meta, requested=episodes is not None)
        chosen |= set(range(meta.total_episodes) if episodes is None else episodes)
    used = sorted(excluded & chosen)
    if used:
        raise RunError(_refusal(meta, used, excluded, any(_yields_all(data_set) for data_set in data_sets)))
    require_finite_frames(meta.root, chosen, meta.features)
    replacement_statistics(meta.root, meta.stats, chosen, meta.total_episodes)
    record_conditions(config, meta, chosen)
    return frozenset()


def record_conditions(config: PairPolicyConfig, meta: Any, episodes: Collection[int] | None) -> None:
    """Records rate, world settings, and properties that policies do not observe, of the training data in `config`.

    Args:
        episodes: episodes to train on; None for all.
    """
    fps = float(meta.fps)
    if config.fps is not None and config.fps != fps:
        logging.warning("The policy was trained at %g frames a second; %s has %g", config.fps, meta.repo_id, fps)
    config.fps = fps
    for name, frames in config.frames_at_30_hz.items():
        if fps != _PUBLISHED_FPS and getattr(config, name) == frames:
            logging.warning(
                "%s: %s = %d is for data of %d frames a second, and %s has %g; convert with --fps %d, or "
                "multiply all settings in frames by %.2g", config.type, name, frames, _PUBLISHED_FPS, meta.repo_id, fps,
                _PUBLISHED_FPS, fps / _PUBLISHED_FPS,
            )  # fmt: skip
    counts = _settings_counts(meta, episodes)
    recorded = [text for text in counts if text]
    settings = json.loads(recorded[0]) if len(recorded) == 1 else None
    if settings is not None and config.physics is not None and config.physics != settings:
        logging.warning("The policy was trained under other physics: %s; these data: %s", config.physics, settings)
    config.physics = settings
    config.physics_mixture = dict(counts) if len(counts) > 1 else {}
    config.unseen = _unseen(get_task(config.filled.task), meta, episodes)
    if config.unseen:
        logging.warning("Of the episodes to train on, %s", config.unseen)
    if len(recorded) > 1:
        logging.warning(
            "The episodes were recorded under different physics, which the checkpoint records as a mixture: %s",
            "; ".join(f"{count} episodes {text or 'unknown'}" for text, count in counts.items()),
        )


def require_same_rate(config: PairPolicyConfig) -> None:
    """Refuses an environment of another task or rate than the policy's training data.

    Logs where its settings differ from those of the training data, and properties that policies do not observe.

    Raises:
        InvalidValueError: task or `--env.fps` differ from those of the checkpoint.
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
    settings = asdict(environment.world_settings)
    learned = {name: value for name, value in (config.physics or {}).items() if name in settings}
    if any(not math.isclose(value, settings[name]) for name, value in learned.items()):
        both = replace(environment.world_settings, **learned), environment.world_settings
        logging.warning("The policy learned under %s; the environment has %s", *map(task.settings_summary, both))
    if unseen := task.unseen_summary([task.columns_of(scenario) for scenario in environment.scenarios]):
        logging.warning("Of the maps of the environment, %s", unseen)


def _unseen(task: PairTask, meta: Any, episodes: Collection[int] | None) -> str:
    """`PairTask.unseen_summary` of the episodes to train on."""
    scenario = next(iter(scenarios[0] for scenarios in task.scenario_sets.values() if scenarios), None)
    columns = meta.episodes
    names = [name for name in task.columns_of(scenario) if name in columns.column_names] if columns and scenario else []
    if not names:
        return ""
    rows = zip(*(columns[name] for name in names), strict=True)
    return task.unseen_summary(
        [
            dict(zip(names, row, strict=True))
            for episode, row in zip(columns["episode_index"], rows, strict=True)
            if episodes is None or episode in episodes
        ]
    )


def _settings_counts(meta: Any, episodes: Collection[int] | None) -> Counter[str]:
    """Number of episodes by world settings, as JSON without the step limit; an empty string if not recorded."""
    columns = meta.episodes
    if columns is None or _PHYSICS not in columns.column_names:
        return Counter()
    counts: Counter[str] = Counter()
    for episode, text in zip(columns["episode_index"], columns[_PHYSICS], strict=True):
        if episodes is None or episode in episodes:
            counts[_dynamics(text)] += 1
    return counts


def _dynamics(text: str | None) -> str:
    try:
        settings = json.loads(text or "{}")
        return (
            json.dumps({name: float(settings[name]) for name in sorted(settings) if name != _STEP_LIMIT})
            if settings
            else ""
        )
    except (ValueError, TypeError, AttributeError):
        raise RunError(f"meta/episodes: expected the settings of the physics as JSON, found {text!r}") from None


def _yields_all(data_set: Any) -> bool:
    """Whether a data set yields episodes that were not requested, as LeRobot's streamed data set does."""
    return isinstance(data_set, StreamingLeRobotDataset) and not isinstance(data_set, CheckedStream)


def _refusal(meta: Any, used: list[int], excluded: frozenset[int], streamed: bool) -> str:
    text = f"{meta.root}: expected no excluded episode among those to train on, found {used}; train with copolicy-train"
    if streamed:
        return f"{text}, since LeRobot's streamed data set yields every episode"
    included = ",".join(str(episode) for episode in range(meta.total_episodes) if episode not in excluded)
    return f"{text}, which leaves them out, or give --dataset.episodes=[{included}]"
