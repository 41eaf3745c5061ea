"""Scores by a factor of the starts, such as their orientation."""

import json
from collections import Counter
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
    """Scores for each value of each factor with 2 to 12 values.

    Policies act worse in starts that their demonstrations lack, so a ranking over all starts can be one of data.

    The scores of all values are over the same partners, else a column would stand for a partner: a `replay`, which has
    its own starts, has a part only if they have the same values.

    Args:
        names: factors of the task's scenarios, see `Studies.factors`.
        rows: rows by robot and partner.
        own_rows: of each partner's own kind; its reference on a map is that of all starts.
        ranked, floors: see `partner_scores`.
        methods: see `method_scores`.

    Returns:
        By factor and value (as text, numbers by size) the entries of `partner_scores`, and `methods`.
    """
    found: dict[str, dict[str, Any]] = {}
    for name in names:
        values = {
            partner: _values(name, cell) for partner, cell in own_rows.items() if any(row["success"] for row in cell)
        }
        several = Counter(each for each in values.values() if 1 < len(each) <= _MOST_VALUES)
        if not several:
            continue
        ((shared, _),) = several.most_common(1)
        own = {partner: own_rows[partner] for partner, each in values.items() if each == shared}
        found[name] = {value: _scores(name, value, rows, own, ranked, floors, methods) for value in shared}
    return found


def _value_text(value: Any) -> str:
    """A factor's value as a key: a number with four significant digits, a text as it is, others as JSON."""
    if isinstance(value, float):
        return f"{round(value, 9) + 0.0:.4g}"  # no -0
    return value if isinstance(value, str) else json.dumps(value)


def _values(name: str, rows: Sequence[Row]) -> tuple[str, ...]:
    """Values of a factor in the starts of a partner; starts without one are left out."""
    values = {_value_text(row[name]): row[name] for row in rows if row.get(name) is not None}

    def order(text: str) -> tuple[bool, float, str]:
        number = isinstance(values[text], int | float)
        return not number, values[text] if number else 0.0, text

    return tuple(sorted(values, key=order))


def _scores(
    name: str,
    value: str,
    rows: Cells,
    own_rows: Mapping[str, Sequence[Row]],
    ranked: Sequence[str],
    floors: Sequence[str],
    methods: Mapping[str, Sequence[str]],
) -> dict[str, Any]:
    """Scores in the starts with a value, with the partners of `own_rows`."""
    chosen = {
        robot: {
            partner: [row for row in by_partner[partner] if _value_text(row.get(name)) == value] for partner in own_rows
        }
        for robot, by_partner in rows.items()
    }
    scores = partner_scores(chosen, own_rows, ranked, floors)
    return {**scores, "methods": method_scores(methods, scores, chosen, own_rows, floors)}
