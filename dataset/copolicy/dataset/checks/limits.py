"""The limits of the rules, each with its unit and reason."""

import functools
from collections.abc import Mapping
from dataclasses import replace

from ..shared_device import IDENTICAL
from ..task import PairTask
from ..task_parts import Limit

RULES_VERSION = "1.3.0"
"""Version of the rules and limits, stored in check reports: major if the meaning of a finding changes, minor if a rule
is added or removed, patch if a limit changes."""


LIMITS: dict[str, Limit | None] = {
    "timestamp": Limit(1e-4, "s", "LeRobot's own tolerance between a timestamp and its frame"),
    "frame_statistics.warning": Limit(
        1e-3, "of the column's range", "sums over millions of frames in single precision; LeRobot joins parts"
    ),
    "frame_statistics.error": Limit(
        0.25, "of the column's range", "a policy would normalise by numbers of another data set"
    ),
    "duration": Limit(1.0, "frames", "the last frame may have fewer steps than the others"),
    "jump": None,
    "late_ticks.warning": Limit(0.01, "share", "the 99th percentile of the periods should be on time"),
    "late_ticks.error": Limit(0.10, "share", "every tenth action was applied to a state that people did not see yet"),
    "achieved_hz.warning": Limit(0.01, "share of {hz} Hz", "a loop on a monotonic clock is far more accurate"),
    "achieved_hz.error": Limit(0.05, "share of {hz} Hz", "speeds seen by people and speeds stored differ visibly"),
    "drift.warning": None,
    "drift.error": None,
    "action_range": Limit(1.0 + 1e-6, "full force", "actions are in [-1, 1]; single precision rounds"),
    "state_range": Limit(1e-6, "of the bounds' range", "states are stored in single precision"),
    "unit_circle": None,
    "previous_action": Limit(1e-6, "full force", "observation.human_action is a copy of the action one frame before"),
    "idle_force": Limit(0.1, "full force", "below it a stick is at rest with any dead zone"),
    "idle.warning": Limit(
        0.9, "share of frames", "a player who gives no force in nine of ten frames hardly takes part"
    ),
    "idle.error": Limit(1.0, "share of frames", "no force in the whole episode: the device was not connected"),
    "idle_run": Limit(5.0, "s", "people pause to negotiate, but rarely for longer"),
    "identical": Limit(
        IDENTICAL,
        "share of frames with force",
        "two people never push identically for an episode; one device listed twice does",
    ),
    "saturated_force": Limit(0.98, "full force", "at the stop of the stick, with room for its calibration"),
    "saturated": Limit(0.9, "share of frames", "a stick always at its stop is a keyboard or is badly scaled"),
    "short": Limit(1.0, "s", "shorter than one prediction horizon of the policy"),
    "stuck_speed": None,
    "stuck": None,
    "unmoved": None,
    "map_position": Limit(1e-6, "of the bounds' range", "scenarios are stored in single precision"),
    "map_start": Limit(0.01, "of the bounds' range", "nothing moves far within the first frame"),
    "contact_margin": None,
    "balance.p": Limit(0.01, "p of a chi-square test", "one balanced data set in a hundred gets a false warning"),
    "balance.expected": Limit(5.0, "episodes a cell", "below it the chi-square approximation does not hold"),
    "balance.pairs": Limit(3.0, "largest / smallest pair", "above it the policy mostly imitates one pair"),
}
"""Generic limits in listing order; None is a placeholder for a limit that only a task can define."""


@functools.cache
def limits_of(task: PairTask) -> Mapping[str, Limit]:
    """The limits for data of a task: generic limits, overridden and extended by those of the task."""
    limits = {**LIMITS, **task.rules.limits}
    hz = task.spec.record_hz
    return {name: replace(limit, unit=limit.unit.format(hz=hz)) for name, limit in limits.items() if limit is not None}
