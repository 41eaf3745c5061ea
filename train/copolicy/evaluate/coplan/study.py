"""The co-planning study of one policy on one map set: its settings, and its result and figure as files."""

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from copolicy.dataset.scenarios import ScenarioSet

from ..study_flags import Protocol, study_settings
from ..summary import not_measured, percent, summarise
from ..trajectories import write_result
from .figure import save_path_figure
from .rollouts import EpisodeResult, coplan

if TYPE_CHECKING:
    from tqdm import tqdm

    from copolicy.train.checkpoint import Checkpoint


def coplan_settings(arguments: argparse.Namespace, protocol: Protocol, chosen: ScenarioSet) -> dict[str, Any]:
    """The `settings` entry of a result.

    Args:
        arguments: flags of the study: `orientations`, `limit`, `repeats`, and those of `study_settings`.
        chosen: the scenarios, before `--limit`.
    """
    scenarios = chosen.scenarios[: arguments.limit]
    return {
        "maps": chosen.label,
        "map_set": chosen.describe(),
        "orientations": arguments.orientations,
        "map_count": len(scenarios),
        "complete_set": arguments.limit is None,
        "repeats": arguments.repeats,
        **study_settings(arguments, protocol, scenarios),
    }


def coplan_result(
    policy: "Checkpoint",
    protocol: Protocol,
    scenarios: Sequence[Any],
    settings: Mapping[str, Any],
    on_step: Callable[[int], object] = lambda finished: None,
) -> tuple[dict[str, Any], list[EpisodeResult]]:
    """Runs the study; returns its result and its episodes.

    Args:
        policy: with the number of actions of a chunk that are executed.
        settings: see `coplan_settings`.
        on_step: called after each step with the number of finished episodes.
    """
    episodes = coplan(
        policy,
        scenarios,
        protocol.settings,
        repeats=settings["repeats"],
        fps=protocol.fps,
        seed=settings["seed"],
        on_step=on_step,
    )
    summary = summarise(episodes, policy)
    result = {
        "study": "coplan",
        "label": "co-planning in simulation: both players act on one sampled plan, no person took part",
        "policy": policy.describe(),
        "settings": settings,
        "summary": summary,
        **not_measured(protocol.task, summary),
        "episodes": [episode.to_json() for episode in episodes],
    }
    return result, episodes


def write_coplan_result(
    policy: "Checkpoint",
    protocol: Protocol,
    scenarios: Sequence[Any],
    settings: dict[str, Any],
    out: Path,
    bar: "tqdm[Any]",
    trajectories: bool = False,
) -> dict[str, Any]:
    """Runs the study, and writes its result and, if the task has an outline, the figure beside it.

    Args:
        policy: with the number of actions of a chunk that are executed.
        settings: see `coplan_settings`.
        out: result file, replaced if it exists.
        bar: progress bar of finished episodes.
        trajectories: also write the trajectories beside the result.
    """
    first = bar.n
    result, episodes = coplan_result(
        policy, protocol, scenarios, settings, lambda finished: bar.update(first + finished - bar.n)
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    success = result["summary"]["success"]
    rate = f"{percent(success)} of {success['episodes']} episodes"
    title = f"{policy.name} in co-planning on {settings['maps']}, in simulation: {rate}"
    if protocol.task.outline is not None:
        save_path_figure(episodes, out.with_suffix(".png"), title)
    named = ((policy.name, episode) for episode in episodes)
    # Last, so that an existing result is always complete.
    write_result(out, result, protocol.task, result["label"], named if trajectories else None)
    return result
