"""The findings of all shards and of the merged data set as one list."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from copolicy.dataset.checks.checking import DATA_SET_RULES, check_table
from copolicy.dataset.checks.finding import SEVERITIES, Finding
from copolicy.dataset.checks.read_lerobot import read_lerobot

from .plan import ShardRecord


def all_findings(root: Path, records: Sequence[ShardRecord]) -> list[Finding]:
    """What the shards found in their recordings, then what the other rules find in the data set; worst first.

    Args:
        root: the merged data set; episodes are named by their index in it.
        records: of all shards, in order.
    """
    findings: list[Finding] = []
    totals: Counter[Finding] = Counter()
    before = 0
    for record in records:
        for fields in record["findings"]:
            finding = Finding(**fields)
            if finding.episode:
                findings.append(Finding(**{**fields, "episode": str(before + int(finding.episode))}))
            elif isinstance(finding.figure, int):  # a number of episodes
                totals[Finding(**{**fields, "figure": None})] += finding.figure
            else:
                findings.append(finding)
        before += len(record["episodes"])
    for finding, total in totals.items():
        findings.append(Finding("", finding.rule, total, finding.limit, finding.severity, finding.message))
    findings += check_table(read_lerobot(root), DATA_SET_RULES).findings
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))
