"""Studies as functions of episodes, for notebooks: run one, say how sure it is, compare two on the same starts."""

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
    n_action_steps: int = 8,
    limit: int | None = None,
    seed: int = 0,
) -> list[Episode]:
    """The paper's co-planning study: both players act on one action chunk, as in `copolicy-eval coplan`.

    Args:
        policy: a checkpoint, a training run, `pretrained`, or what `load_policy` gives.
        maps: name of a set of scenarios, a file of maps, or scenarios themselves.
        n_action_steps: actions of a chunk that are executed before the next one.
        limit: number of scenarios, the first ones; all if None.
        seed: of the noise that chunks are denoised from.

    Returns:
        One episode a scenario, at the settings of the world that the policy learned at.

    Raises:
        FileFormatError: no such checkpoint.
        InvalidValueError: a chunk has fewer actions.
        UnknownNameError: no such set.
    """
    loaded: Any = load_policy(policy) if isinstance(policy, str) else policy
    if not 1 <= n_action_steps <= loaded.chunk_size:
        raise InvalidValueError("n_action_steps", f"1 to {loaded.chunk_size}, the actions of a chunk", n_action_steps)
    loaded.n_action_steps = loaded.wanted = n_action_steps
    task = get_task(loaded.task)
    settings, steps = loaded.conditions.settings, task.studies.step_limit
    settings = settings if steps is None else replace(settings, step_limit=steps)
    robot = PolicyAgent(loaded, task, seed=seed)
    return run_episodes(robot, None, maps, task=loaded.task, limit=limit, seed=seed, settings=settings)


def success(episodes: Sequence[Episode]) -> dict[str, Any]:
    """Share of successes with its binomial standard error and Wilson's 95 % interval (`mean`, `standard_error`,
    `wilson_95`, `episodes`); it says nothing about other training seeds.

    Raises:
        InvalidValueError: no episode.
    """
    if not episodes:
        raise InvalidValueError("episodes", "at least one", "none")
    return success_rate([episode.meta.success for episode in episodes])


def compare_episodes(first: Sequence[Episode], second: Sequence[Episode]) -> dict[str, Any]:
    """Mean of `first - second` on the same starts with a 95 % interval, bootstrapped over maps.

    Returns:
        For `success`, `time_s` (where both succeeded) and, where the task measures it, `interaction_mean` and
        `interaction_p95`: `mean`, `bootstrap_95`, `pairs` and `maps`.

    Raises:
        InvalidValueError: episodes of other starts.
    """
    starts = [[episode.scenario.digest for episode in episodes] for episodes in (first, second)]
    if starts[0] != starts[1] or not first:
        raise InvalidValueError("second", f"the {len(first)} starts of the first, in order", f"{len(second)} others")
    one, other = (episode_values(map(_row, range(len(first)), episodes)) for episodes in (first, second))
    return paired_differences(one, other)


def _row(index: int, episode: Episode) -> dict[str, Any]:
    task, meta = get_task(episode.task), episode.meta
    # Of the state that each action led to, as in results of the studies.
    after = np.vstack((episode.states[1:], episode.final_state))
    interaction = task.interaction(after, episode.actions)
    about = {"map_index": index, "map_id": meta.map_id, "repeat": 0, "success": meta.success}
    return {**about, "time_s": meta.duration_s, **interaction_columns(interaction)}
