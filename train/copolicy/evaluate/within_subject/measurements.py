"""The values that a within-subject analysis starts from: one for each unit of analysis and cell of the design."""

import csv
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError

_TRUTHS = {"true": 1.0, "false": 0.0}


@dataclass(frozen=True)
class Measurements:
    """A measure of every unit in every cell of a design with one or two factors.

    Attributes:
        measure: name of the measure.
        unit: what a unit of analysis is, such as "participant" or "map".
        units: names of the units, n.
        factors: levels by name of the factor; one or two factors, in the order of their first row.
        values: `(n, k)` or `(n, k1, k2)`, the mean over a unit's rows of a cell.
        rows_per_cell: smallest and largest number of rows behind a value.
        left_out: units without a value in every cell.
    """

    measure: str
    unit: str
    units: tuple[str, ...]
    factors: dict[str, tuple[str, ...]]
    values: Array
    rows_per_cell: tuple[int, int]
    left_out: tuple[str, ...]

    @classmethod
    def of_rows(
        cls, rows: Iterable[Mapping[str, Any]], measure: str, unit: str, factors: Sequence[str]
    ) -> "Measurements":
        """Takes the mean over the rows of each unit and cell; rows without a value (None, NaN) are left out.

        Raises:
            InvalidValueError: the number of factors is not one or two.
        """
        if len(factors) not in (1, 2):
            raise InvalidValueError("factors", "one or two", list(factors))
        cells: dict[tuple[str, ...], dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
        names: dict[str, None] = {}
        levels: dict[str, dict[str, None]] = {factor: {} for factor in factors}
        for row in rows:
            names[str(row[unit])] = None
            for factor in factors:
                levels[factor][str(row[factor])] = None
            value = row[measure]
            if value is not None and math.isfinite(value):
                cells[tuple(str(row[factor]) for factor in factors)][str(row[unit])].append(float(value))
        grid = list(product(*levels.values()))
        complete = [name for name in names if all(cells[cell][name] for cell in grid)]
        shape = (len(complete), *map(len, levels.values()))
        values = np.array([[np.mean(cells[cell][name]) for cell in grid] for name in complete]).reshape(shape)
        counts = [len(cells[cell][name]) for cell in grid for name in complete]
        return cls(
            measure,
            unit,
            tuple(complete),
            {factor: tuple(found) for factor, found in levels.items()},
            values,
            (min(counts, default=0), max(counts, default=0)),
            tuple(name for name in names if name not in complete),
        )

    @classmethod
    def read(cls, path: Path, measure: str, unit: str, factors: Sequence[str]) -> "Measurements":
        """Reads a CSV with a header and one row a trial; true and false count as 1 and 0, an empty value is left out.

        Raises:
            FileFormatError: the file cannot be read, lacks a column, has a value that is no number, or no unit that has
                a value in every cell.
        """
        columns = (unit, *factors, measure)
        expected = f"a CSV with the columns {', '.join(columns)}"
        try:
            with path.open(encoding="utf-8-sig", newline="") as file:
                rows = list(csv.DictReader(file))
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            text = error.strerror if isinstance(error, OSError) else None
            raise FileFormatError(path, expected, text or str(error)) from None
        if not rows:
            raise FileFormatError(path, expected, "no rows")
        if missing := [column for column in columns if column not in rows[0]]:
            raise FileFormatError(path, expected, f"no column {' and '.join(missing)}")
        numbered = []
        for number, row in enumerate(rows, 2):
            if empty := [column for column in (unit, *factors) if not (row[column] or "").strip()]:
                raise FileFormatError(path, expected, f"no {' and '.join(empty)} in line {number}")
            labels = {column: row[column].strip() for column in (unit, *factors)}
            numbered.append({**labels, measure: _number(path, number, measure, row[measure])})
        found = cls.of_rows(numbered, measure, unit, factors)
        if not found.units:
            raise FileFormatError(path, f"a {unit} with {measure} in every cell of {' x '.join(factors)}", "none")
        return found

    @property
    def description(self) -> str:
        """The unit of analysis in one sentence; every output states it."""
        low, high = self.rows_per_cell
        rows = f"{low}" if low == high else f"{low} to {high}"
        means = "one value" if (low, high) == (1, 1) else f"the mean of {rows} rows"
        text = f"unit of analysis: the {self.unit}, n = {len(self.units)}; {means} in each condition"
        return text + (
            f"; left out without a value in every condition: {', '.join(self.left_out)}" * bool(self.left_out)
        )

    def over(self, factor: str) -> Array:
        """`(n, k)` values by the levels of one factor, means over the levels of the second."""
        axis = 1 + list(self.factors).index(factor)
        return self.values if self.values.ndim == 2 else self.values.mean(axis=3 - axis)


def _number(path: Path, line: int, measure: str, text: str | None) -> float | None:
    text = (text or "").strip()
    if not text:
        return None
    try:
        value = _TRUTHS.get(text.lower())
        value = float(text) if value is None else value
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FileFormatError(path, f"a number for {measure} in line {line}", repr(text))
    return value
