"""Version numbers of data sets and their Git tags."""

import re
from dataclasses import dataclass
from typing import Literal

from ..exceptions import InvalidValueError

Bump = Literal["major", "minor", "patch"]

BUMPS: tuple[Bump, ...] = ("patch", "minor", "major")
"""In increasing order."""

TAG_PREFIX = "data-"
"""LeRobot rewrites a revision such as `1.2` to `v1.2`; it does not change a tag with this prefix."""


@dataclass(frozen=True, order=True)
class DataVersion:
    """Semantic version of a data set."""

    major: int
    minor: int
    patch: int

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.patch}"

    @property
    def tag(self) -> str:
        """`data-x.y.z`."""
        return f"{TAG_PREFIX}{self}"

    @classmethod
    def parse(cls, text: str) -> "DataVersion":
        """Reads `1.2.3` or `data-1.2.3`.

        Raises:
            InvalidValueError: another form.
        """
        match = re.fullmatch(rf"(?:{TAG_PREFIX})?(0|[1-9]\d*)\.(0|[1-9]\d*)\.(0|[1-9]\d*)", text)
        if not match:
            raise InvalidValueError("data version", "x.y.z or data-x.y.z", text)
        return cls(*map(int, match.groups()))

    def bumped(self, bump: Bump) -> "DataVersion":
        """The next version."""
        return {
            "major": DataVersion(self.major + 1, 0, 0),
            "minor": DataVersion(self.major, self.minor + 1, 0),
            "patch": DataVersion(self.major, self.minor, self.patch + 1),
        }[bump]


def newest_version(tags: list[str]) -> DataVersion | None:
    """The highest data version among tags; ignores other tags, None if there is no data version."""
    versions = []
    for tag in tags:
        if tag.startswith(TAG_PREFIX):
            try:
                versions.append(DataVersion.parse(tag))
            except InvalidValueError:
                continue  # another tag with this prefix, such as data-draft
    return max(versions, default=None)
