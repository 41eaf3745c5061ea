"""Summaries of a study with partners: of one robot, and of two robots on the same starts with the same partners."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from copolicy.dataset.task import PairTask

from ..comparison.paired import BOOTSTRAP, episode_values, paired_differences
from ..summary import summarise
from .episode_result import DEADLOCK_S, PartnerEpisodeResult

if TYPE_CHECKING:
    from copolicy.train.checkpoint import Checkpoint


def definitions(task: PairTask, summary: dict[str, Any]) -> dict[str, str]:
    """Definitions of the measures of a summary; those that are null are left out."""
    words = task.studies.definitions
    ends = words.get("success", f"end with {' or '.join(task.spec.successes)}")
    texts = {
        "success": f"proportion of episodes that {ends}; standard error binomial, over episodes of one training",
        "time_to_completion_s": "of successes only",
        "interaction_force": f"{words.get('interaction_force', 'magnitude of what the task measures')}, over all steps",
        "robot_share": "proportion of both players' positive work that the robot does on "
        f"{words.get('work', 'the point that the task follows')}, mean over episodes; 0.5 is even",
        "deadlock": f"standing ({words.get('at_rest', 'as the task defines it')}) for {DEADLOCK_S:g} s or more: "
        "proportion of all time, and of the episodes in which it occurs",
        "partner_changes": f"how often the partner changed {words.get('change', 'its route choice')}, mean over "
        "episodes with a scripted partner",
        "differences": f"first robot minus the other on the same starts with the same partners; 95 %: {BOOTSTRAP}; "
        "time only where both succeed",
    }
    return {name: text for name, text in texts.items() if summary.get(name, "") is not None}


def summarise_with_partners(episodes: Sequence[PartnerEpisodeResult], policy: "Checkpoint | None") -> dict[str, Any]:
    """The summary of `eval.json`: that of co-planning, and the measures of the partner in total and by kind."""
    by_partner: dict[str, list[PartnerEpisodeResult]] = {}
    by_orientation: dict[int, list[bool]] = {}
    for episode in episodes:
        by_partner.setdefault(episode.partner, []).append(episode)
        theta = episode.task.studies.factors(episode.scenario).get("start_theta")
        if theta is not None:
            by_orientation.setdefault(round(math.degrees(theta)) % 360, []).append(episode.success)
    turned = {str(degrees): sum(flags) / len(flags) for degrees, flags in sorted(by_orientation.items())}
    return {
        **summarise(episodes, policy),
        **_with_partner(episodes),
        "by_partner": {kind: _short(part) for kind, part in by_partner.items()},
        **({"by_orientation_deg": turned} if turned else {}),
    }


def differences(first: Sequence[PartnerEpisodeResult], second: Sequence[PartnerEpisodeResult]) -> dict[str, Any]:
    """Paired differences `first - second` of two robots, in total and by kind of partner."""
    both = [[episode.to_json() for episode in episodes] for episodes in (first, second)]
    result = {"all": paired_differences(*map(episode_values, both))}
    for kind in dict.fromkeys(episode.partner for episode in first):
        of_kind = (episode_values(row for row in rows if row["partner"] == kind) for rows in both)
        result[kind] = paired_differences(*of_kind)
    return result


def _short(episodes: Sequence[PartnerEpisodeResult]) -> dict[str, Any]:
    summary = summarise(episodes, None)
    measures = ("success", "ended_by", "time_to_completion_s", "interaction_force")
    return {**{name: summary[name] for name in measures}, **_with_partner(episodes)}


def _with_partner(episodes: Sequence[PartnerEpisodeResult]) -> dict[str, Any]:
    steps, record_hz = sum(episode.steps for episode in episodes), episodes[0].task.spec.record_hz
    proportions = [proportion for episode in episodes if (proportion := episode.robot_share) is not None]
    deadlocks = [seconds for episode in episodes if (seconds := episode.deadlock_s) is not None]
    in_deadlock = sum(seconds > 0 for seconds in deadlocks) / len(episodes)
    changes = [episode.partner_changes for episode in episodes if episode.partner_changes is not None]
    time_share = sum(deadlocks) * record_hz / steps if deadlocks else None
    return {
        "robot_share": float(np.mean(proportions)) if proportions else None,
        "deadlock": {"time_share": time_share, "episode_share": in_deadlock} if deadlocks else None,
        "partner_changes": float(np.mean(changes)) if changes else None,
    }
