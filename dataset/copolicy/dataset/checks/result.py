"""The result of a check, as plain data."""

from dataclasses import dataclass

from .episode_data import EpisodeData
from .finding import Finding


@dataclass(frozen=True)
class CheckResult:
    """The result of a check.

    Attributes:
        data: the checked data.
        findings: most severe first, then in the order of the rules.
        applied: names of the applied rules.
        not_applied: the other rules, each with the reason.
    """

    data: EpisodeData
    findings: tuple[Finding, ...]
    applied: tuple[str, ...]
    not_applied: dict[str, str]

    def count(self, severity: str) -> int:
        """Number of findings with a severity."""
        return sum(finding.severity == severity for finding in self.findings)

    def failed(self, strict: bool = False) -> bool:
        """Whether there is an error or, with `strict`, a warning."""
        return bool(self.count("error") or (strict and self.count("warning")))
