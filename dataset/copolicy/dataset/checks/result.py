"""What a check found. Plain data."""

from dataclasses import dataclass

from .episode_data import EpisodeData
from .finding import Finding


@dataclass(frozen=True)
class CheckResult:
    """What was found.

    Attributes:
        findings: worst first, then in the order of the rules.
        applied: names of the rules that were applied.
        not_applied: the others, each with the reason.
    """

    table: EpisodeData
    findings: tuple[Finding, ...]
    applied: tuple[str, ...]
    not_applied: dict[str, str]

    def count(self, severity: str) -> int:
        """Findings of a severity."""
        return sum(finding.severity == severity for finding in self.findings)

    def failed(self, strict: bool = False) -> bool:
        """Whether the data should not be used: an error, with `strict` also a warning."""
        return bool(self.count("error") or (strict and self.count("warning")))
