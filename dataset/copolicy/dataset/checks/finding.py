"""One finding of a check."""

import math
from dataclasses import asdict, dataclass
from typing import Any, Literal

Severity = Literal["error", "warning", "info"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "info")
Figure = float | int | str | None


@dataclass(frozen=True)
class Finding:
    """One finding: episode, rule, measured figure and its limit, severity and message.

    Attributes:
        episode: index of the episode in a LeRobot data set, or file name in a folder of recordings; empty for a finding
            about the whole.
        rule: name of the violated rule or limit.
        figure: measured value.
        limit: value with which the figure was compared.
    """

    episode: str
    rule: str
    figure: Figure
    limit: Figure
    severity: Severity
    message: str

    def to_dict(self) -> dict[str, Any]:
        """A JSON-compatible dictionary; NaN and infinity become None."""
        return {
            name: None if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in asdict(self).items()
        }

    def __str__(self) -> str:
        prefix = f"episode {self.episode}: " if self.episode else ""
        figures = "" if self.figure is None else f" ({_text(self.figure)}; limit {_text(self.limit)})"
        return f"{self.severity}: {self.rule}: {prefix}{self.message}{figures}"


def _text(value: Figure) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value).strip() or "nothing"
