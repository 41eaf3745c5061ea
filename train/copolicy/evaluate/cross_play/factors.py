"""Scores by a factor of the starts, such as their orientation."""

from collections.abc import Mapping, Sequence
from typing import Any

from .measures import Row
from .methods import method_scores
from .score import Cells, partner_scores

_MOST_VALUES = 12
"""A factor with more values, such as recorded starts have, is left out."""


def by_factor(
    names: Sequence[str],
    rows: Cells,
    own_rows: Mapping[str, Sequence[Row]],
    ranked: Sequence[str],
    floors: Sequence[str],
    methods: Mapping[str, Sequence[str]],
) -> dict[str, dict[str, Any]]:
    """Scores for each value of each factor with several values.

    Policies act worse in starts that their demonstrations lack, so a ranking over all starts can be one of data.

    Args:
        names: factors of the task's scenarios, see `Studies.factors`.
        rows: rows by robot and partner.
        own_rows: of each partner's own kind; its reference on a map is that of all starts.
        ranked, floors: see `partner_scores`.
        methods: see `method_scores`.

    Returns:
        By factor and value (as text) the entries of `partner_scores`, and `methods`.
    """
    found: dict[str, dict[str, Any]] = {}
    for name in names:
        every = [row[name] for by_partner in rows.values() for cell in by_partner.values() for row in cell]
        values = sorted(set(map(value_text, every)), key=float)
        if 1 < len(values) <= _MOST_VALUES:
            found[name] = {value: _scores(name, value, rows, own_rows, ranked, floors, methods) for value in values}
    return found


def value_text(value: float) -> str:
    """A factor's value as a key: at most three decimals."""
    return f"{value:.3f}".rstrip("0").rstrip(".")


def _scores(
    name: str,
    value: str,
    rows: Cells,
    own_rows: Mapping[str, Sequence[Row]],
    ranked: Sequence[str],
    floors: Sequence[str],
    methods: Mapping[str, Sequence[str]],
) -> dict[str, Any]:
    def of_value(cell: Sequence[Row]) -> list[Row]:
        return [row for row in cell if value_text(row[name]) == value]

    partners = [
        partner
        for partner in next(iter(rows.values()))
        if all(of_value(by_partner[partner]) for by_partner in rows.values())
    ]
    chosen = {
        robot: {partner: of_value(by_partner[partner]) for partner in partners} for robot, by_partner in rows.items()
    }
    known = {partner: own_rows[partner] for partner in partners if partner in own_rows}
    scores = partner_scores(chosen, known, ranked, floors)
    return {**scores, "methods": method_scores(methods, scores, chosen, known, floors)}
