"""What a data set mixes: said when it is made, before somebody takes unlike episodes for alike."""

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
    """Of the episodes of one data set.

    Attributes:
        physics: episodes by their settings of the dynamics, in words.
        mixed: a line for each thing that is not the same in all episodes.
    """

    physics: dict[str, int]
    mixed: list[str] = field(default_factory=list)

    @classmethod
    def of(
        cls,
        rows: Iterable[Mapping[str, Any]],
        task: PairTask | None = None,
        where: Path | str = "",
        records: Iterable[Mapping[str, Any]] = (),
        rewards: Iterable[str] = (),
    ) -> "Mixtures":
        """From the episode columns of each episode of a task, the table by default.

        Args:
            where: the data set, for the message.
            records: of its conversions, `meta/copolicy.json`; several versions of the converter are a mixture.
            rewards: lines about rewards of another definition.

        Raises:
            FileFormatError: the column `physics` of an episode cannot be read.
        """
        rows = list(rows)
        try:
            physics = count_settings((row.get("physics") for row in rows), task)
        except InvalidValueError as error:
            raise FileFormatError(where, "episodes that say their physics", str(error)) from None
        counts: dict[str, Mapping[str, int]] = {"physics": physics}
        for name in _COLUMNS:
            counts[name] = Counter(str(row.get(name) or "none") for row in rows)
        sizes: dict[str, Counter[str]] = {}
        for row in rows:
            # Maps of a file have obstacles of any size.
            if (size := row.get("obstacle_size")) and not row.get("map_set_digest"):
                sizes.setdefault(str(row.get("map_set") or "none"), Counter())[f"{size} px"] += 1
        counts |= {f"obstacles of map set {name}": found for name, found in sizes.items()}
        lines = [f"{name}: {_listed(found)}" for name, found in counts.items() if len(found) > 1]
        versions = {str(record["version"]) for record in records if "version" in record}
        lines += [f"converted by versions {', '.join(sorted(versions))}"] if len(versions) > 1 else []
        return cls(dict(physics), [*lines, *rewards])

    def summary(self) -> dict[str, Any]:
        """For the end of a command, which says on stderr, too, what changes the motion itself."""
        for line in self.mixed:
            if line.startswith(("physics", "obstacles", "rewards")):
                logging.warning("warning: this data set mixes %s", line)
        return {"physics": self.physics, **({"mixed": self.mixed} if self.mixed else {})}


def _listed(counts: Mapping[str, int]) -> str:
    return "; ".join(f"{count} {'episode' if count == 1 else 'episodes'} {name}" for name, count in counts.items())
