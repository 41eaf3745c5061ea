"""Every number that a rule measures against, in one table, each with its reason."""

from dataclasses import dataclass

from ..interaction import IDENTICAL

RULES_VERSION = "1.3.0"
"""Of the rules and their limits: major where a finding means something else, minor where a rule is added or goes,
patch where a limit moves. Kept findings name it."""


@dataclass(frozen=True)
class Limit:
    """A number and why it is that one."""

    value: float
    unit: str
    reason: str


LIMITS: dict[str, Limit] = {
    "timestamp": Limit(1e-4, "s", "LeRobot's own tolerance between a timestamp and its frame"),
    "frame_statistics.warning": Limit(
        1e-3, "of the column's range", "sums over millions of frames in single precision; LeRobot joins parts"
    ),
    "frame_statistics.error": Limit(
        0.25, "of the column's range", "a policy would normalise by numbers of another data set"
    ),
    "duration": Limit(1.0, "frames", "the last frame may hold fewer steps than the others"),
    "jump": Limit(
        52.0, "px/s", "terminal speed of an axis under two full forces is 50 px/s; 4 % for other integrators"
    ),
    "late_ticks.warning": Limit(0.01, "share", "the 99th percentile of the periods should be on time"),
    "late_ticks.error": Limit(0.10, "share", "every tenth action was given to a world that people did not see yet"),
    "achieved_hz.warning": Limit(0.01, "share of 30 Hz", "a loop on a monotonic clock keeps far closer"),
    "achieved_hz.error": Limit(0.05, "share of 30 Hz", "speeds seen by people and speeds stored differ visibly"),
    "drift.warning": Limit(1.0, "px", "contacts are decided to a pixel; our own recordings replay below 1e-6"),
    "drift.error": Limit(10.0, "px", "a third of the table's width: the replay passes obstacles differently"),
    "action_range": Limit(1.0 + 1e-6, "full force", "actions are in [-1, 1]; single precision rounds"),
    "unit_circle": Limit(1e-3, "1", "cos^2 + sin^2 is 1 up to single precision"),
    "previous_action": Limit(1e-6, "full force", "observation.human_action is a copy of the action one frame before"),
    "idle_force": Limit(0.1, "full force", "below it a stick is at rest, whatever its dead zone"),
    "idle.warning": Limit(
        0.9, "share of frames", "a player who gives no force in nine of ten frames hardly takes part"
    ),
    "idle.error": Limit(1.0, "share of frames", "no force in the whole episode: the device was not connected"),
    "idle_run": Limit(5.0, "s", "people pause to negotiate, but rarely this long with the table in hand"),
    "identical": Limit(
        IDENTICAL,
        "share of frames with force",
        "two people never push alike for an episode; one device listed twice does",
    ),
    "saturated_force": Limit(0.98, "full force", "at the stop of the stick, with room for its calibration"),
    "saturated": Limit(0.9, "share of frames", "a stick always at its stop is a keyboard or is badly scaled"),
    "short": Limit(1.0, "s", "shorter than one prediction horizon of the policy"),
    "stuck_speed": Limit(2.0, "px/s", "4 % of the table's terminal speed"),
    "stuck": Limit(5.0, "s", "a table that rests this long is blocked, or nobody is there"),
    "unmoved": Limit(20.0, "px", "a tenth of the table's length: nothing was carried"),
    "map_position": Limit(1.0, "px", "maps are stored in single precision"),
    "map_start": Limit(5.0, "px", "a table at rest moves less in the first frame, whatever is stored first"),
    "contact_margin": Limit(2.0, "px", "two pixel grids, and the picture's rounded corners"),
    "balance.p": Limit(0.01, "p of a chi-square test", "one balanced data set in a hundred is warned of by chance"),
    "balance.expected": Limit(5.0, "episodes a cell", "below it the chi-square approximation does not hold"),
    "balance.pairs": Limit(3.0, "largest / smallest pair", "beyond it the policy mostly imitates one pair"),
}


def limit(name: str) -> float:
    """The number of a rule's limit."""
    return LIMITS[name].value
