"""The record of withdrawals, `meta/copolicy_withdrawals.json`: when participants withdrew how many episodes, not which.

In records of earlier releases an entry without name or digest replaces each withdrawn episode, so that the next
release can count the removed episodes; the content hash of such a record cannot be recomputed.
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


class _WithdrawalsDocument(TypedDict):
    withdrawals: list[_Withdrawal]


def read_withdrawals(root: Path) -> list[dict[str, Any]]:
    """Reads date and number of episodes of each withdrawal, oldest first; empty if there is no record.

    Raises:
        FileFormatError: not a record of withdrawals.
    """
    path = root / WITHDRAWALS_FILE
    if not path.is_file():
        return []
    entries = read_json(path, _WithdrawalsDocument, f"a record of withdrawals ({_SCHEMA})")["withdrawals"]
    return [{"date": entry["date"], "episodes": entry["episodes"]} for entry in entries]


def withdrawals_text(entries: Iterable[dict[str, Any]]) -> str:
    """The record as JSON text."""
    return json.dumps({"schema": _SCHEMA, "withdrawals": list(entries)}, indent=2) + "\n"


def is_anonymous(episode: EpisodeContent) -> bool:
    """Whether an entry replaces a withdrawn episode."""
    return _ANONYMOUS.fullmatch(episode.episode_uuid) is not None


def anonymise(content: Content, is_withdrawn: Callable[[EpisodeContent], bool]) -> Content:
    """Replaces withdrawn episodes by entries without name, length and digests."""
    number = sum(is_anonymous(episode) for episode in content.episodes)
    episodes: list[EpisodeContent] = []
    for episode in content.episodes:
        if is_withdrawn(episode):
            number += 1
            episode = EpisodeContent(f"withdrawn-{number}", "", 0, {}, {})
        episodes.append(episode)
    return replace(content, episodes=tuple(episodes))
