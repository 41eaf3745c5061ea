"""Runs every rule over a data set."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..exceptions import FileFormatError
from ..files.file_kinds import describe_path
from ..files.listing import broken_links, distinct_files
from ..files.meta_files import INFO_FILE
from ..task import PairTask
from ..task_parts import Rule
from . import balance, check_sums, inputs, leakage, loading, maps, mixtures, schema, timing
from .episode_table import EpisodeTable
from .finding import SEVERITIES, Finding
from .read_recordings import read_recordings
from .result import CheckResult

RULES: tuple[Rule, ...] = (
    *schema.RULES,
    *check_sums.RULES,
    *loading.RULES,
    *timing.RULES,
    *inputs.RULES,
    *timing.MOTION_RULES,
    *leakage.DUPLICATE_RULES,
    *maps.RULES,
    Rule("goal_contact", "rule for where successes end"),
    Rule("obstacle_contact", "rule for the obstacles on its way"),
    Rule("wall_contact", "rule for the walls around it"),
    *balance.RULES,
    *mixtures.CONSENT_RULES,
    *leakage.RULES,
    *mixtures.RULES,
)
"""The generic rules in the order of the report, and the places of those that only a task can bring."""


def rules_of(task: PairTask) -> tuple[Rule, ...]:
    """Every rule for data of a task."""
    own = {rule.name: rule for rule in task.rules.rules}
    return (*(own.pop(rule.name, rule) for rule in RULES), *own.values())


def of_recordings(rule: Rule) -> bool:
    """Whether a rule says something of each recording, whatever else there is: any part of a folder can be held
    against such rules on its own, and the data set that the recordings became against the others."""
    return "recordings" in rule.kinds and not rule.whole


def of_data_sets(rule: Rule) -> bool:
    """The others: both together leave no rule out."""
    return not of_recordings(rule)


def read_table(root: Path) -> EpisodeTable:
    """A LeRobot data set (it has `meta/info.json`) or a folder of recordings.

    Raises:
        FileFormatError: neither, or data of a task that is not installed.
        MissingExtraError: a LeRobot data set without pyarrow.
    """
    if (root / INFO_FILE).is_file():
        from .read_lerobot import read_lerobot

        return read_lerobot(root)
    if not root.is_dir() or not distinct_files(root, "*.mcap", "*.mcap.part"):
        broken = [f"a link that leads nowhere, {path.name}" for path in broken_links(root)] if root.is_dir() else []
        found = broken[0] if broken else describe_path(root)
        raise FileFormatError(root, "recordings (*.mcap) or a LeRobot data set (meta/info.json)", found)
    return read_recordings(root)


def check_dataset(root: Path, against: Path | None = None) -> CheckResult:
    """Applies every rule that the data have the columns for. Nothing is changed.

    Args:
        root: a LeRobot data set or a folder of recordings.
        against: another one that must share no episode with it, for example the test data.
    """
    result = check_table(read_table(root))
    return result if against is None else add_leaks(result, root, against)


def add_leaks(result: CheckResult, root: Path, against: Path) -> CheckResult:
    """The same with the episodes that a data set shares with another one.

    Args:
        result: of the check of `root`.
    """
    other = read_table(against)
    shared = leakage.leaks(
        leakage.Part(root.name, result.table, range(len(result.table.labels))),
        leakage.Part(against.name, other, range(len(other.labels))),
    )
    findings = _worst_first([*result.findings, *shared])
    return CheckResult(result.table, findings, (*result.applied, "against"), result.not_applied)


def check_table(table: EpisodeTable, wanted: Callable[[Rule], bool] = lambda rule: True) -> CheckResult:
    """Applies every wanted rule that a table has the columns for and its task the part."""
    findings: list[Finding] = []
    applied: list[str] = []
    not_applied: dict[str, str] = {}
    for rule in filter(wanted, rules_of(table.task)):
        reason = _why_not(rule, table)
        if reason or rule.find is None:
            not_applied[rule.name] = reason or table.task.missing(rule.what)
            continue
        applied.append(rule.name)
        with np.errstate(all="ignore"):  # a number that is none is a finding of `finite`
            findings += rule.find(table)
    lacking = [name for name, reason in not_applied.items() if reason.startswith("needs")]
    if lacking and not any(finding.severity == "error" for finding in findings):
        # Whatever these rules were to find may be there.
        message = f"rules that could not be applied: {', '.join(f'{name} {not_applied[name]}' for name in lacking)}"
        findings.append(Finding("", "applied", len(lacking), 0, "error", message))
    return CheckResult(table, _worst_first(findings), tuple(applied), not_applied)


def _worst_first(findings: list[Finding]) -> tuple[Finding, ...]:
    return tuple(sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity)))


def _why_not(rule: Rule, table: EpisodeTable) -> str:
    if table.kind not in rule.kinds:
        return f"says nothing about {table.kind}"
    missing = [name for name in rule.columns if name not in table.columns]
    missing += [name for name in rule.frames if name not in table.frames]
    if missing:
        return f"needs {', '.join(missing)}"
    if rule.frames and not len(table.starts):
        return "needs the frames of at least one episode"
    return ""
