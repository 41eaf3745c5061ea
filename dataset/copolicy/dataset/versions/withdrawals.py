"""That episodes were withdrawn by the people who played them, and when; not which: `meta/copolicy_withdrawals.json`.

Earlier releases keep an entry without name or digest in the place of each, so that the next release can count what
went; their content hash can no longer be worked out from their entries.
"""

import json
import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypedDict

from ..files.json_file import read_json
from ..files.meta_files import WITHDRAWALS_FILE
from .digests import Content, EpisodeContent

_SCHEMA = "copolicy-withdrawals-1"
_ANONYMOUS = re.compile(r"withdrawn-\d+")


class _Withdrawal(TypedDict):
    date: str
    episodes: int


class _File(TypedDict):
    withdrawals: list[_Withdrawal]


def read_withdrawals(root: Path) -> list[dict[str, Any]]:
    """Date and number of episodes of each withdrawal, oldest first; none where there is no record.

    Raises:
        FileFormatError: a record of another form.
    """
    path = root / WITHDRAWALS_FILE
    if not path.is_file():
        return []
    entries = read_json(path, _File, f"a record of withdrawals ({_SCHEMA})")["withdrawals"]
    return [{"date": entry["date"], "episodes": entry["episodes"]} for entry in entries]


def withdrawals_text(entries: Iterable[dict[str, Any]]) -> str:
    """The text of the file."""
    return json.dumps({"schema": _SCHEMA, "withdrawals": list(entries)}, indent=2) + "\n"


def is_anonymous(episode: EpisodeContent) -> bool:
    """Whether an entry only says that an episode was there."""
    return _ANONYMOUS.fullmatch(episode.episode_uuid) is not None


def anonymised(content: Content, gone: Callable[[EpisodeContent], bool]) -> Content:
    """A content with entries without name, length and digests in the place of some episodes."""
    number = sum(is_anonymous(episode) for episode in content.episodes)
    episodes: list[EpisodeContent] = []
    for episode in content.episodes:
        if gone(episode):
            number += 1
            episode = EpisodeContent(f"withdrawn-{number}", "", 0, {}, {})
        episodes.append(episode)
    return replace(content, episodes=tuple(episodes))
