"""Tables in Markdown, for the reports of all studies."""

from collections.abc import Mapping, Sequence
from typing import Any


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table from its header and its rows of equal length."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def estimate_text(value: Mapping[str, Any] | None, scale: float, digits: int) -> str:
    """`mean ± standard_error` of an estimate, each times a factor; without an error the mean alone, else `none`."""
    if value is None:
        return "none"
    mean, error = f"{scale * value['mean']:.{digits}f}", value["standard_error"]
    return mean if error is None else f"{mean} ± {scale * error:.{digits}f}"
