"""Applies the rules to a data set or to recordings."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..exceptions import FileFormatError
from ..files.file_kinds import describe_path
from ..files.listing import broken_links, distinct_files
from ..files.meta_files import INFO_FILE
from ..task import PairTask
from ..task_parts import Rule
from . import balance, episode_scenario, inputs, integrity, leakage, loading, provenance, schema, timing
from .episode_data import EpisodeData
from .finding import SEVERITIES, Finding
from .read_recordings import read_recordings
from .result import CheckResult

RULES: tuple[Rule, ...] = (
    *schema.RULES,
    *integrity.RULES,
    *loading.RULES,
    *timing.RULES,
    *inputs.RULES,
    *timing.MOTION_RULES,
    *leakage.DUPLICATE_RULES,
    *episode_scenario.RULES,
    Rule("goal_contact", "rule for where successes end"),
    Rule("obstacle_contact", "rule for the obstacles on its way"),
    Rule("wall_contact", "rule for the walls around it"),
    *balance.RULES,
    *provenance.CONSENT_RULES,
    *leakage.RULES,
    *provenance.RULES,
)
"""The generic rules in the order of the report, with placeholders for rules that only a task can define."""


def rules_of(task: PairTask) -> tuple[Rule, ...]:
    """All rules for data of a task: generic rules, replaced and extended by those of the task."""
    task_rules = {rule.name: rule for rule in task.rules.rules}
    return (*(task_rules.pop(rule.name, rule) for rule in RULES), *task_rules.values())


def judges_one_recording(rule: Rule) -> bool:
    """Whether a rule judges each recording on its own, so that it can be applied to any part of a folder."""
    return "recordings" in rule.kinds and not rule.whole


def judges_data_set(rule: Rule) -> bool:
    """Whether a rule needs the whole data set: every rule that `judges_one_recording` excludes."""
    return not judges_one_recording(rule)


def read_data(root: Path) -> EpisodeData:
    """Reads a LeRobot data set (a folder with `meta/info.json`) or a folder of recordings.

    Raises:
        FileFormatError: the folder is neither, or its task is not installed.
    """
    if (root / INFO_FILE).is_file():
        from .read_lerobot import read_lerobot

        return read_lerobot(root)
    if not root.is_dir() or not distinct_files(root, "*.mcap", "*.mcap.part"):
        broken = next(iter(broken_links(root)), None) if root.is_dir() else None
        actual = describe_path(root) if broken is None else f"a link that leads nowhere, {broken.name}"
        raise FileFormatError(root, "recordings (*.mcap) or a LeRobot data set (meta/info.json)", actual)
    return read_recordings(root)


def check_dataset(root: Path | str, against: Path | str | None = None) -> CheckResult:
    """Checks a LeRobot data set or a folder of recordings; changes nothing.

    Args:
        root: folder to check.
        against: another folder that must share no episode with it, for example the test data.

    Raises:
        FileFormatError: a folder is neither a data set nor recordings, or its task is not installed.
    """
    root = Path(root)
    result = check_data(read_data(root))
    return result if against is None else add_leaks(result, root, Path(against))


def add_leaks(result: CheckResult, root: Path, against: Path) -> CheckResult:
    """Adds findings for the episodes and people that `root`, with the check result `result`, shares with `against`."""
    against_data = read_data(against)
    shared = leakage.leaks(
        leakage.ComparedEpisodes(root.name, result.data, range(len(result.data.labels))),
        leakage.ComparedEpisodes(against.name, against_data, range(len(against_data.labels))),
    )
    findings = _worst_first([*result.findings, *shared])
    return CheckResult(result.data, findings, (*result.applied, "against"), result.not_applied)


def check_data(data: EpisodeData, applies: Callable[[Rule], bool] = lambda rule: True) -> CheckResult:
    """Applies the rules for which `applies` is true and the data have the columns and the task the part."""
    findings: list[Finding] = []
    applied: list[str] = []
    not_applied: dict[str, str] = {}
    for rule in filter(applies, rules_of(data.task)):
        reason = _reason_not_applied(rule, data)
        if reason or rule.find is None:
            not_applied[rule.name] = reason or data.task.missing(rule.what)
            continue
        applied.append(rule.name)
        with np.errstate(all="ignore"):  # NaN is a finding of the rule `finite`
            findings += rule.find(data)
    unapplied = [name for name, reason in not_applied.items() if reason.startswith("needs")]
    if unapplied and not any(finding.severity == "error" for finding in findings):
        # The data may violate these rules.
        message = f"rules that could not be applied: {', '.join(f'{name} {not_applied[name]}' for name in unapplied)}"
        findings.append(Finding("", "applied", len(unapplied), 0, "error", message))
    return CheckResult(data, _worst_first(findings), tuple(applied), not_applied)


def _worst_first(findings: list[Finding]) -> tuple[Finding, ...]:
    return tuple(sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity)))


def _reason_not_applied(rule: Rule, data: EpisodeData) -> str:
    if data.kind not in rule.kinds:
        return f"does not apply to {data.kind}"
    missing = [name for name in rule.columns if name not in data.columns]
    missing += [name for name in rule.frames if name not in data.frames]
    if missing:
        return f"needs {', '.join(missing)}"
    if rule.frames and not len(data.starts):
        return "needs the frames of at least one episode"
    return ""
