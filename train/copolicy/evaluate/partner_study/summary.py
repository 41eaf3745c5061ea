"""What a study with partners reports of a robot, and of two robots on the same starts with the same partners."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from copolicy.dataset.task_spec import RECORD_HZ

from ..comparison.paired import BOOTSTRAP, episode_values, paired_differences
from ..summary import summarise
from .outcome import DEADLOCK_S, STILL_SPEED, STILL_SPIN, PartnerOutcome

if TYPE_CHECKING:
    from copolicy.train.checkpoint import Checkpoint

DEFINITIONS = {
    "success": "share of episodes that touch the goal; standard error binomial, over episodes of one training",
    "time_to_completion_s": "of successes only",
    "interaction_force": "|(u_robot - u_partner) . e| / 2 along the table, full forces, over all steps",
    "robot_share": "robot's share of the positive work of both on the table's centre, mean over episodes; 0.5 is even",
    "deadlock": f"standing (below {STILL_SPEED:g} px/s and {STILL_SPIN:g} rad/s) for {DEADLOCK_S:g} s or more on end: "
    "share of all time, and of the episodes in which it happens",
    "partner_changes": "how often the partner changed its mind about the route, mean over episodes",
    "differences": f"first robot minus the other on the same starts with the same partners; 95 %: {BOOTSTRAP}; time "
    "only where both succeed",
}


def summarise_with_partners(outcomes: Sequence[PartnerOutcome], policy: "Checkpoint | None") -> dict[str, Any]:
    """The summary of `eval.json`: that of co-planning, and what concerns the partner, in all and for each kind."""
    by_partner: dict[str, list[PartnerOutcome]] = {}
    by_orientation: dict[int, list[PartnerOutcome]] = {}
    for outcome in outcomes:
        by_partner.setdefault(outcome.partner, []).append(outcome)
        by_orientation.setdefault(round(math.degrees(outcome.map_config.start[2])) % 360, []).append(outcome)
    return {
        **summarise(outcomes, policy),
        **_with_partner(outcomes),
        "by_partner": {kind: _short(part) for kind, part in by_partner.items()},
        "by_orientation_deg": {
            str(degrees): sum(one.success for one in part) / len(part)
            for degrees, part in sorted(by_orientation.items())
        },
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
    steps = sum(outcome.steps for outcome in outcomes)
    stuck = [outcome.deadlock_s for outcome in outcomes]
    return {
        "robot_share": float(np.mean([outcome.robot_share for outcome in outcomes])),
        "deadlock": {
            "time_share": sum(stuck) * RECORD_HZ / steps,
            "episode_share": sum(seconds > 0 for seconds in stuck) / len(stuck),
        },
        "partner_changes": float(np.mean([outcome.partner_changes for outcome in outcomes])),
    }
