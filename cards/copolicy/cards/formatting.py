"""Formats Markdown and numbers for the cards."""

from collections.abc import Iterable

from copolicy.dataset.task import PairTask


def table(header: Iterable[object], rows: Iterable[Iterable[object]]) -> str:
    """A table; pipes in cells are escaped."""
    head = list(header)
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(_cell(cell) for cell in line) + " |" for line in lines)


def count_text(count: int, total: int) -> str:
    """`5 of 6 (83.3 %)`."""
    return f"{count} of {total} ({100 * count / max(1, total):.1f} %)"


def counts_text(counts: dict[str, int], most: int = 12) -> str:
    """Values with the number of occurrences; `not stated` for the empty value."""
    text = ", ".join(f"{value or 'not stated'} ({count})" for value, count in list(counts.items())[:most])
    return text + (f", and {len(counts) - most} more" if len(counts) > most else "")


def missing_part_note(task: PairTask, part: str) -> str:
    """Sentence for a card or page on the contents left out because the task lacks a part."""
    return f"L{task.missing(part)[1:]}."


def format_number(value: object) -> str:
    """A number with four significant digits; a dash for None."""
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _cell(cell: object) -> str:
    return " ".join(str(cell).replace("|", "\\|").split())
