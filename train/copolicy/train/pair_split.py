"""`--split` of `copolicy-train`: chooses the episodes of some pairs, or of all others."""

import re
from dataclasses import dataclass
from typing import Any

from copolicy.dataset.command_line.flag_numbers import LARGEST_SEED
from copolicy.dataset.edit.groups import group_episodes
from copolicy.dataset.edit.parts import Part, assign_groups
from copolicy.dataset.exceptions import InvalidValueError, RunError

SPLIT_HELP = "pairs:ID,ID, not-pairs:ID,ID, pairs:FRACTION[:SEED] or not-pairs:FRACTION[:SEED]"

_COLUMNS = ("source", "map_set", "pair_id", "player_0_id", "player_1_id", "consent_id", "source_sha256", "map_id")


@dataclass(frozen=True)
class PairSplit:
    """A choice of pairs.

    Attributes:
        text: as given, for records.
        complement: the other pairs.
        names: named pairs; empty for a fraction.
        fraction: proportion of the episodes, reached with whole pairs as closely as possible.
        seed: of the order of pairs of equal size.
    """

    text: str
    complement: bool
    names: tuple[str, ...] = ()
    fraction: float = 0.0
    seed: int = 0

    @classmethod
    def parse(cls, text: str) -> "PairSplit":
        """Parses the value of `--split`.

        Raises:
            InvalidValueError: another form.
        """
        match = re.fullmatch(r"(not-)?pairs:(.+)", text)
        if match is None:
            raise InvalidValueError("--split", SPLIT_HELP, text)
        complement, value = bool(match[1]), match[2]
        number = re.fullmatch(r"(0?\.\d+)(?::(\d{1,10}))?", value)
        if number is None:
            names = tuple(name for name in value.split(",") if name)
            if not names:
                raise InvalidValueError("--split", SPLIT_HELP, text)
            return cls(text, complement, names)
        fraction, seed = float(number[1]), int(number[2] or 0)
        if not 0 < fraction < 1 or seed > LARGEST_SEED:
            expected = f"a fraction above 0 and below 1, and a seed of at most {LARGEST_SEED}"
            raise InvalidValueError("--split", expected, text)
        return cls(text, complement, (), fraction, seed)

    def episodes(self, meta: Any) -> list[int]:
        """The chosen episodes of a data set, ascending.

        With a fraction, people who acted in two pairs stay together (`group_episodes`). The complement of equal
        fraction and seed has exactly the other episodes.

        Args:
            meta: LeRobot's metadata of the data set.

        Raises:
            RunError: the data set has no `pair_id`, or too few pairs for a fraction.
            InvalidValueError: no such pair, or none left.
        """
        table = meta.episodes
        if table is None or "pair_id" not in table.column_names:
            raise RunError(f"{meta.root}: expected the episode column pair_id for --split, found none")
        names = [name for name in _COLUMNS if name in table.column_names]
        columns = {name: list(table[name]) for name in names}
        rows = [{name: columns[name][index] or "" for name in names} for index in range(len(columns["pair_id"]))]
        if self.names:
            present = {row["pair_id"] for row in rows}
            if unknown := sorted(set(self.names) - present):
                available = ", ".join(sorted(name for name in present if name)) or "none"
                raise InvalidValueError("--split", f"pairs of the data set ({available})", ", ".join(unknown))
            chosen = [index for index, row in enumerate(rows) if (row["pair_id"] in self.names) != self.complement]
            if not chosen:
                raise InvalidValueError("--split", "a choice that leaves a pair", self.text)
            return chosen
        # Copies of an episode have the same recording; motions are not compared, which would read all frames.
        groups = group_episodes(rows, list(range(len(rows))), "pairs")
        parts = [Part("chosen", self.fraction), Part("rest", 1 - self.fraction)]
        assignment = assign_groups(rows, groups, parts, "pairs", self.seed, "--split")
        return assignment["rest" if self.complement else "chosen"]
