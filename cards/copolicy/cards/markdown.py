"""Pieces of Markdown that the cards are made of."""

from collections.abc import Iterable

from copolicy.dataset.task import PairTask


def table(header: Iterable[object], rows: Iterable[Iterable[object]]) -> str:
    """A table; what a cell holds cannot end it."""
    head = list(header)
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(_cell(cell) for cell in line) + " |" for line in lines)


def share(count: int, total: int) -> str:
    """`5 of 6 (83.3 %)`."""
    return f"{count} of {total} ({100 * count / max(1, total):.1f} %)"


def listing(counts: dict[str, int], most: int = 12) -> str:
    """Values with how often each occurs; `not stated` for the empty one."""
    text = ", ".join(f"{value or 'not stated'} ({count})" for value, count in list(counts.items())[:most])
    return text + (f", and {len(counts) - most} more" if len(counts) > most else "")


def left_out(task: PairTask, part: str) -> str:
    """The sentence of a card or page that lacks what needs a part of the task."""
    return f"L{task.missing(part)[1:]}."


def number(value: object) -> str:
    """Four significant digits; a dash where there is none."""
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _cell(cell: object) -> str:
    return " ".join(str(cell).replace("|", "\\|").split())
