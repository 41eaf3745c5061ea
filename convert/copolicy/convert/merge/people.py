"""Pseudonyms that two labs gave independently: the same name is not the same person.

Every lab begins with P01. Merged as they are, two pairs would count as one: statistics by pair would mix them, a test
set of new people would hold old ones, and a withdrawn consent would take the wrong episodes along. So a name in two
data sets is refused until somebody says which it is. Simulated pairs are this project's own and are the same
everywhere; they are neither compared nor renamed.
"""

import re
from collections.abc import Sequence

from copolicy.dataset.edit.subset.stored_set import StoredSet
from copolicy.dataset.exceptions import InvalidValueError, MissingExtraError

try:
    import pyarrow as pa
except ModuleNotFoundError:
    raise MissingExtraError("pyarrow") from None

LOCAL_NAMES = ("session_id", "pair_id", "player_0_id", "player_1_id", "consent_id")
"""The episode columns whose names a lab gives for itself."""

_KINDS = {"pair_id": "pair", "player_0_id": "player", "player_1_id": "player", "consent_id": "consent"}


def require_prefixes(prefixes: Sequence[str], count: int) -> None:
    """Checks the names of the labs.

    Raises:
        InvalidValueError: not one for each data set, one twice, or one that is no plain word.
    """
    if len(prefixes) != count or len(set(prefixes)) != count:
        raise InvalidValueError("--prefix-people", f"{count} different names, one for each data set", list(prefixes))
    for prefix in prefixes:
        if not re.fullmatch(r"[A-Za-z0-9_]+", prefix):
            raise InvalidValueError("--prefix-people", "names of letters, digits and underscores", prefix)


def require_strangers(sources: Sequence[StoredSet]) -> None:
    """Checks that no pair, player or consent record has the same name in two data sets.

    Raises:
        InvalidValueError: one has.
    """
    seen: dict[tuple[str, str], StoredSet] = {}
    for source in sources:
        names = {(kind, name): source for column, kind in _KINDS.items() for name in _given(source, column)}
        for kind, name in sorted(names):
            if (kind, name) in seen:
                raise InvalidValueError(
                    f"{kind} {name!r}",
                    "a name in one of the data sets only, or --prefix-people LAB LAB (other people) or "
                    "--same-people (the same)",
                    f"it in {seen[kind, name].root} and {source.root}",
                )
        seen |= names


def renamed(episodes: "pa.Table", prefix: str) -> "pa.Table":
    """Rows of meta/episodes with `prefix-` before every name that the lab gave for itself."""
    simulated = episodes.column("source").to_pylist()
    for column in LOCAL_NAMES:
        place = episodes.column_names.index(column)
        names = [
            f"{prefix}-{name}" if name and source != "simulated" else name
            for name, source in zip(episodes.column(column).to_pylist(), simulated, strict=True)
        ]
        field = episodes.schema.field(place)
        episodes = episodes.set_column(place, field, pa.array(names, field.type))
    return episodes


def _given(source: StoredSet, column: str) -> set[str]:
    rows = source.episodes.select([column, "source"]).to_pylist()
    return {row[column] for row in rows if row[column] and row["source"] != "simulated"}
