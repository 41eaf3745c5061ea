"""Studies for notebooks: run co-planning, compute the success rate, compare two policies on the same starts."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from copolicy.collect.agents import Policy, PolicyAgent, load_policy
from copolicy.collect.episodes import run_episodes
from copolicy.dataset.episode import Episode
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import get_task

from .comparison.paired import episode_values, paired_differences
from .coplan.rollouts import interaction_columns
from .summary import success_rate


def coplan_episodes(
    policy: Policy | str = "pretrained",
    maps: str | Sequence[Any] = "holdout",
    *,
    n_action_steps: int | None = None,
    limit: int | None = None,
    seed: int = 0,
) -> list[Episode]:
    """Runs the paper's co-planning study: both players execute one action chunk, as in `copolicy-eval coplan`.

    Args:
        policy: a checkpoint, a training run, `pretrained`, or a policy loaded by `load_policy`.
        maps: name of a scenario set, a scenario file, or a sequence of scenarios.
        n_action_steps: actions of a chunk that are executed before the next chunk is predicted; 8, or all of a shorter
            chunk, if None.
        limit: use only the first `limit` scenarios; all if None.
        seed: seed of the noise from which chunks are denoised.

    Returns:
        One episode per scenario, simulated with the world settings of the policy's training data.

    Raises:
        FileFormatError: the checkpoint does not exist.
        InvalidValueError: `n_action_steps` is outside 1 to the policy's chunk size.
        UnknownNameError: the scenario set does not exist.
    """
    loaded: Any = load_policy(policy) if isinstance(policy, str) else policy
    n_action_steps = min(8, loaded.chunk_size) if n_action_steps is None else n_action_steps
    if not 1 <= n_action_steps <= loaded.chunk_size:
        raise InvalidValueError("n_action_steps", f"1 to {loaded.chunk_size}, the actions of a chunk", n_action_steps)
    loaded.n_action_steps = loaded.n_predicted_actions = n_action_steps
    task = get_task(loaded.task)
    settings, step_limit = loaded.conditions.settings, task.studies.step_limit
    settings = settings if step_limit is None else replace(settings, step_limit=step_limit)
    robot = PolicyAgent(loaded, task, seed=seed)
    return run_episodes(robot, None, maps, task=loaded.task, limit=limit, seed=seed, settings=settings)


def success(episodes: Sequence[Episode]) -> dict[str, Any]:
    """Success rate with its binomial standard error and Wilson's 95 % interval.

    Returns:
        `mean`, `standard_error`, `wilson_95` and `episodes`. The interval does not cover the choice of training seed.

    Raises:
        InvalidValueError: `episodes` is empty.
    """
    if not episodes:
        raise InvalidValueError("episodes", "at least one", "none")
    return success_rate([episode.meta.success for episode in episodes])


def compare_episodes(first: Sequence[Episode], second: Sequence[Episode]) -> dict[str, Any]:
    """Mean difference `first - second` on the same starts with a 95 % interval, bootstrapped over maps.

    Returns:
        `mean`, `standard_error`, `bootstrap_95`, `pairs` and `maps` for `success`, for `time_s` (episodes in which both
        succeeded) and, if the task measures interaction, for `interaction_mean` and `interaction_p95`.

    Raises:
        InvalidValueError: the episodes do not have the same starts.
    """
    starts = [[episode.scenario.digest for episode in episodes] for episodes in (first, second)]
    if starts[0] != starts[1] or not first:
        raise InvalidValueError("second", f"the {len(first)} starts of the first, in order", f"{len(second)} others")
    values = [episode_values(map(_row, range(len(first)), episodes)) for episodes in (first, second)]
    return paired_differences(*values)


def _row(index: int, episode: Episode) -> dict[str, Any]:
    task, meta = get_task(episode.task), episode.meta
    # Of the state that each action led to, as in results of the studies.
    after = np.vstack((episode.states[1:], episode.final_state))
    interaction = task.interaction(after, episode.actions)
    about = {"map_index": index, "map_id": meta.map_id, "repeat": 0, "success": meta.success}
    return {**about, "time_s": meta.duration_s, **interaction_columns(interaction)}
