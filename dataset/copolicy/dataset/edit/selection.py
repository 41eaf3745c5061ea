"""Selects episodes by number, person, consent, map, result, source or a condition on their columns."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, get_args

from ..episode import GENERIC_REASONS, Source
from ..exceptions import InvalidValueError, RunError
from ..lerobot_folder.episode_rows import select_episodes
from ..task import get_task, installed_tasks
from .expression import parse_condition

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Selection:
    """Criteria that an episode must meet: one of the values of each field that is not empty.

    Attributes:
        episodes: numbers, ranges such as `3-5`, or `episode_uuid`s.
        pairs, map_sets, map_ids, sources: values of the episode columns.
        players: player ids at either seat.
        consents: ids in `consent_id`, which may have several.
        results: `success`, `failure`, or termination reasons.
        where: a condition (`expression.parse_condition`).
        drop_excluded: leave out discarded and excluded episodes.
    """

    episodes: tuple[str, ...] = ()
    pairs: tuple[str, ...] = ()
    players: tuple[str, ...] = ()
    consents: tuple[str, ...] = ()
    map_sets: tuple[str, ...] = ()
    map_ids: tuple[str, ...] = ()
    results: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()
    where: str = ""
    drop_excluded: bool = False

    def __post_init__(self) -> None:
        reasons = (reason for name in installed_tasks() for reason in get_task(name).spec.reasons)
        results = ("success", "failure", *dict.fromkeys(reasons), *GENERIC_REASONS) if self.results else ()
        for name, values, choices in (
            ("--results", self.results, results),
            ("--sources", self.sources, get_args(Source)),
        ):
            for value in values:
                if value not in choices:
                    raise InvalidValueError(name, f"one of {', '.join(choices)}", value)

    def criteria(self) -> dict[str, Any]:
        """The fields that are not empty, as JSON values."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items() if value}

    def numbers(self, rows: Sequence[Row], types: Mapping[str, str]) -> list[int]:
        """The ascending numbers of the selected episodes.

        Args:
            rows: the episode columns of every episode, in order.
            types: type of each column that a condition may use: `str`, `int`, `float` or `bool`.

        Raises:
            InvalidValueError, UnknownNameError: no such episode, or an invalid condition.
            RunError: a value that no episode has.
        """
        numbers_by_uuid = {row["episode_uuid"]: row["episode_index"] for row in rows if row.get("episode_uuid")}
        selected = select_episodes(self.episodes, (row["episode_index"] for row in rows), numbers_by_uuid)
        condition = parse_condition(self.where, types) if self.where else lambda _: True
        filters = {
            "--pair-ids": (self.pairs, lambda row: {row.get("pair_id")}),
            "--player-ids": (self.players, lambda row: {row.get("player_0_id"), row.get("player_1_id")}),
            "--consent-ids": (self.consents, consent_ids),
            "--map-sets": (self.map_sets, lambda row: {row.get("map_set")}),
            "--map-ids": (self.map_ids, lambda row: {row.get("map_id")}),
            "--results": (self.results, _results),
            "--sources": (self.sources, lambda row: {row.get("source")}),
        }
        for flag, (values, values_of) in filters.items():
            present = {value for row in rows for value in values_of(row)} if values else set()
            for value in values:
                if value not in present and flag not in ("--results", "--sources"):
                    raise RunError(f"{flag}: expected a value of the data set, found {value!r}, which no episode has")
        return [
            row["episode_index"]
            for row in rows
            if (not self.episodes or row["episode_index"] in selected)
            and all(not values or not values_of(row).isdisjoint(values) for values, values_of in filters.values())
            and not (self.drop_excluded and row.get("discarded"))
            and condition(row)
        ]


def consent_ids(row: Row) -> set[str]:
    """The consent ids of an episode; `consent_id` lists them separated by commas."""
    return {text.strip() for text in (row.get("consent_id") or "").split(",")} - {""}


def _results(row: Row) -> set[Any]:
    return {"success" if row.get("success") else "failure", row.get("termination_reason")}
