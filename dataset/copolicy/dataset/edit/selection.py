"""Which episodes are meant: by number, person, consent, map, result, source or a condition on their columns."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, get_args

from ..episode import OTHER_REASONS, Source
from ..exceptions import InvalidValueError, RunError
from ..lerobot_folder.episode_rows import chosen_episodes
from ..task import get_task, installed_tasks
from .expression import parse_condition

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Selection:
    """Several values of one field: any of them. Several fields: all of them. An empty field asks for nothing.

    Attributes:
        episodes: numbers, ranges such as `3-5`, or `episode_uuid`s.
        pairs, map_sets, map_ids, sources: values of the episode columns.
        players: at either seat.
        consents: one of the ids in `consent_id`, which may hold several.
        results: `success`, `failure`, or how exactly an episode ended.
        where: a condition (`expression.parse_condition`).
        drop_excluded: without what is discarded or excluded.
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

    def __post_init__(self):
        reasons = (reason for name in installed_tasks() for reason in get_task(name).spec.reasons)
        results = ("success", "failure", *dict.fromkeys(reasons), *OTHER_REASONS) if self.results else ()
        for name, values, choices in (
            ("--results", self.results, results),
            ("--sources", self.sources, get_args(Source)),
        ):
            for value in values:
                if value not in choices:
                    raise InvalidValueError(name, f"one of {', '.join(choices)}", value)

    def asked(self) -> dict[str, Any]:
        """The fields that ask for something, JSON-able."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items() if value}

    def numbers(self, rows: Sequence[Row], types: Mapping[str, str]) -> list[int]:
        """The numbers of the episodes that are meant, ascending.

        Args:
            rows: the episode columns of every episode, in order.
            types: `str`, `int`, `float` or `bool` of each column that a condition may name.

        Raises:
            InvalidValueError, UnknownNameError: an episode that is not there, or a condition of another form.
            RunError: a value that no episode has.
        """
        names = {row["episode_uuid"]: row["episode_index"] for row in rows if row.get("episode_uuid")}
        listed = chosen_episodes(self.episodes, (row["episode_index"] for row in rows), names)
        holds = parse_condition(self.where, types) if self.where else lambda _: True
        wanted = {
            "--pair-ids": (self.pairs, lambda row: {row.get("pair_id")}),
            "--player-ids": (self.players, lambda row: {row.get("player_0_id"), row.get("player_1_id")}),
            "--consent-ids": (self.consents, consents_of),
            "--map-sets": (self.map_sets, lambda row: {row.get("map_set")}),
            "--map-ids": (self.map_ids, lambda row: {row.get("map_id")}),
            "--results": (self.results, _results),
            "--sources": (self.sources, lambda row: {row.get("source")}),
        }
        for flag, (values, of) in wanted.items():
            there = {value for row in rows for value in of(row)} if values else set()
            for value in values:
                if value not in there and flag not in ("--results", "--sources"):
                    raise RunError(f"{flag}: expected a value that an episode has, found {value!r}, which none has")
        return [
            row["episode_index"]
            for row in rows
            if (not self.episodes or row["episode_index"] in listed)
            and all(not values or not of(row).isdisjoint(values) for values, of in wanted.values())
            and not (self.drop_excluded and row.get("discarded"))
            and holds(row)
        ]


def consents_of(row: Row) -> set[str]:
    """The consent ids of an episode: `consent_id` holds one for each person, separated by commas."""
    return {text.strip() for text in (row.get("consent_id") or "").split(",")} - {""}


def _results(row: Row) -> set[Any]:
    return {"success" if row.get("success") else "failure", row.get("termination_reason")}
