"""Finds properties that differ between the episodes of a data set, to report them when the data set is written."""

import logging
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.settings_text import count_settings
from copolicy.dataset.task import PairTask

_COLUMNS = ("source", "software_version", "license")


@dataclass(frozen=True)
class Mixtures:
    """Properties that differ between the episodes of one data set.

    Attributes:
        physics: number of episodes by the description of their physics settings.
        mixed: a line for each property that differs.
    """

    physics: dict[str, int]
    mixed: list[str] = field(default_factory=list)

    @classmethod
    def from_rows(
        cls,
        rows: Iterable[Mapping[str, Any]],
        task: PairTask | None = None,
        data_set: Path | str = "",
        records: Iterable[Mapping[str, Any]] = (),
        rewards: Iterable[str] = (),
    ) -> "Mixtures":
        """Compares episode columns.

        Args:
            rows: the episode columns of each episode.
            task: task of the episodes; None is the table.
            data_set: named in the error.
            records: conversion records (`meta/copolicy.json`), whose converter versions are compared.
            rewards: lines from `reward_differences`.

        Raises:
            FileFormatError: the column `physics` of an episode cannot be read.
        """
        rows = list(rows)
        try:
            physics = count_settings((row.get("physics") for row in rows), task)
        except InvalidValueError as error:
            raise FileFormatError(data_set, "episodes that say their physics", str(error)) from None
        counts: dict[str, Mapping[str, int]] = {"physics": physics}
        for name in _COLUMNS:
            counts[name] = Counter(str(row.get(name) or "none") for row in rows)
        obstacle_sizes: dict[str, Counter[str]] = {}
        for row in rows:
            # A map file may have obstacles of any size.
            if (size := row.get("obstacle_size")) and not row.get("map_set_digest"):
                obstacle_sizes.setdefault(str(row.get("map_set") or "none"), Counter())[f"{size} px"] += 1
        counts |= {f"obstacles of map set {name}": sizes for name, sizes in obstacle_sizes.items()}
        lines = [f"{name}: {_count_text(values)}" for name, values in counts.items() if len(values) > 1]
        versions = {str(record["version"]) for record in records if "version" in record}
        lines += [f"converted by versions {', '.join(sorted(versions))}"] if len(versions) > 1 else []
        return cls(dict(physics), [*lines, *rewards])

    def summary(self) -> dict[str, Any]:
        """Entries of a command's summary; also logs a warning for each difference that changes the motion."""
        for line in self.mixed:
            if line.startswith(("physics", "obstacles", "rewards")):
                logging.warning("warning: this data set mixes %s", line)
        return {"physics": self.physics, **({"mixed": self.mixed} if self.mixed else {})}


def _count_text(counts: Mapping[str, int]) -> str:
    return "; ".join(f"{count} {'episode' if count == 1 else 'episodes'} {name}" for name, count in counts.items())
