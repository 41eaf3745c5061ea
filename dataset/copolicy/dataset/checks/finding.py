"""What a check has to say: which episode, which rule, the figure, its limit, and how bad it is."""

import math
from dataclasses import asdict, dataclass
from typing import Literal

Severity = Literal["error", "warning", "info"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "info")
Figure = float | int | str | None


@dataclass(frozen=True)
class Finding:
    """One thing that a person should know before the data are used.

    Attributes:
        episode: index of the episode in a LeRobot data set, name of its file in a folder of recordings; empty where
            the finding is about the whole.
        rule: name of the rule, a key of `limits.LIMITS` or of a rule without a number.
        figure: what was measured.
        limit: what it is measured against.
    """

    episode: str
    rule: str
    figure: Figure
    limit: Figure
    severity: Severity
    message: str

    def to_dict(self) -> dict:
        """JSON-able; numbers that JSON does not know become None."""
        return {
            name: None if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in asdict(self).items()
        }

    def __str__(self) -> str:
        place = f"episode {self.episode}: " if self.episode else ""
        figures = "" if self.figure is None else f" ({_text(self.figure)}; limit {_text(self.limit)})"
        return f"{self.severity}: {self.rule}: {place}{self.message}{figures}"


def _text(value: Figure) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value).strip() or "nothing"
