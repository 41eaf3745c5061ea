"""What a study with partners reports of a robot, and of two robots on the same starts with the same partners."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from copolicy.dataset.task import PairTask

from ..comparison.paired import BOOTSTRAP, episode_values, paired_differences
from ..summary import summarise
from .outcome import DEADLOCK_S, PartnerOutcome

if TYPE_CHECKING:
    from copolicy.train.checkpoint import Checkpoint


def definitions(task: PairTask, summary: dict[str, Any]) -> dict[str, str]:
    """What the measures of a summary mean; those that are null are left out."""
    words = task.studies.definitions
    ends = words.get("success", f"end with {' or '.join(task.spec.successes)}")
    texts = {
        "success": f"share of episodes that {ends}; standard error binomial, over episodes of one training",
        "time_to_completion_s": "of successes only",
        "interaction_force": f"{words.get('interaction_force', 'magnitude of what the task measures')}, over all steps",
        "robot_share": "robot's share of the positive work of both on "
        f"{words.get('work', 'the point that the task follows')}, mean over episodes; 0.5 is even",
        "deadlock": f"standing ({words.get('at_rest', 'as the task defines it')}) for {DEADLOCK_S:g} s or more on end: "
        "share of all time, and of the episodes in which it happens",
        "partner_changes": f"how often the partner changed {words.get('change', 'its mind')}, mean over episodes",
        "differences": f"first robot minus the other on the same starts with the same partners; 95 %: {BOOTSTRAP}; "
        "time only where both succeed",
    }
    return {name: text for name, text in texts.items() if summary.get(name, "") is not None}


def summarise_with_partners(outcomes: Sequence[PartnerOutcome], policy: "Checkpoint | None") -> dict[str, Any]:
    """The summary of `eval.json`: that of co-planning, and what concerns the partner, in all and for each kind."""
    by_partner: dict[str, list[PartnerOutcome]] = {}
    by_orientation: dict[int, list[bool]] = {}
    for outcome in outcomes:
        by_partner.setdefault(outcome.partner, []).append(outcome)
        theta = outcome.task.studies.factors(outcome.map_config).get("start_theta")
        if theta is not None:
            by_orientation.setdefault(round(math.degrees(theta)) % 360, []).append(outcome.success)
    turned = {str(degrees): sum(part) / len(part) for degrees, part in sorted(by_orientation.items())}
    return {
        **summarise(outcomes, policy),
        **_with_partner(outcomes),
        "by_partner": {kind: _short(part) for kind, part in by_partner.items()},
        **({"by_orientation_deg": turned} if turned else {}),
    }


def differences(outcomes: Sequence[PartnerOutcome], other: Sequence[PartnerOutcome]) -> dict[str, Any]:
    """Paired differences of two robots, in all and for each kind of partner."""
    one_rows, other_rows = [one.to_json() for one in outcomes], [one.to_json() for one in other]
    result = {"all": paired_differences(episode_values(one_rows), episode_values(other_rows))}
    for kind in dict.fromkeys(outcome.partner for outcome in outcomes):
        one_part, other_part = (
            episode_values(row for row in rows if row["partner"] == kind) for rows in (one_rows, other_rows)
        )
        result[kind] = paired_differences(one_part, other_part)
    return result


def _short(outcomes: Sequence[PartnerOutcome]) -> dict[str, Any]:
    whole = summarise(outcomes, None)
    kept = ("success", "ended_by", "time_to_completion_s", "interaction_force")
    return {**{name: whole[name] for name in kept}, **_with_partner(outcomes)}


def _with_partner(outcomes: Sequence[PartnerOutcome]) -> dict[str, Any]:
    steps, record_hz = sum(outcome.steps for outcome in outcomes), outcomes[0].task.spec.record_hz
    shares = [share for outcome in outcomes if (share := outcome.robot_share) is not None]
    stuck = [stood for outcome in outcomes if (stood := outcome.deadlock_s) is not None]
    in_deadlock = sum(seconds > 0 for seconds in stuck) / len(outcomes)
    return {
        "robot_share": float(np.mean(shares)) if shares else None,
        "deadlock": {"time_share": sum(stuck) * record_hz / steps, "episode_share": in_deadlock} if stuck else None,
        "partner_changes": float(np.mean([outcome.partner_changes for outcome in outcomes])),
    }
