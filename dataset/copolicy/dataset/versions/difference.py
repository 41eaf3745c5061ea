"""Differences between two contents, and the smallest version bump that each requires.

| bump | change |
|---|---|
| major | rate, robot type, features; a task, an episode column or an episode removed; changed frames or numbers |
| minor | episodes, an episode column or a task were added; episodes were excluded or included |
| patch | values of episode columns were corrected; other files (card, statistics, figures, layout) |
"""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

from ..publication.data_version import BUMPS, Bump
from .digests import Content, EpisodeContent
from .withdrawals import is_anonymous

EXCLUSION = "discarded"
"""The episode column that marks an episode as excluded from training."""

_MAX_SHOWN = 5


@dataclass(frozen=True)
class Change:
    """One line of the change log, and the smallest version bump that it requires."""

    bump: Bump
    text: str


@dataclass(frozen=True)
class Difference:
    """Differences from one content to another; episodes are listed by `episode_uuid`.

    Attributes:
        schema: changes of rate, robot type, features, tasks and the set of episode columns.
        episodes_added, episodes_removed: in the order of the content that has them.
        episodes_changed: for each episode in both, the features and episode columns whose values differ.
        renumbered: episodes in both whose number differs.
        frames_changed: those of `episodes_changed` with different frames, not only episode columns.
        exclusions_changed: those of `episodes_changed` that `copolicy-dataset exclude` excluded or included.
        withdrawn: anonymous entries of `episodes_removed` (see `withdrawals`).
    """

    schema: tuple[Change, ...]
    episodes_added: tuple[str, ...]
    episodes_removed: tuple[str, ...]
    episodes_changed: dict[str, tuple[str, ...]]
    renumbered: tuple[str, ...]
    frames_changed: tuple[str, ...]
    exclusions_changed: tuple[str, ...]
    withdrawn: tuple[str, ...] = ()

    @property
    def same(self) -> bool:
        """Whether there is no difference."""
        return not self.changes

    @property
    def changes(self) -> tuple[Change, ...]:
        """All changes, the largest bump first."""
        listed_uuids = {*self.frames_changed, *self.exclusions_changed}
        metadata = [uuid for uuid in self.episodes_changed if uuid not in listed_uuids]
        columns = {name for uuid in metadata for name in self.episodes_changed[uuid]}
        removed = [uuid for uuid in self.episodes_removed if uuid not in self.withdrawn]
        changes = [
            *self.schema,
            *_withdrawal_changes(len(self.withdrawn)),
            *_episode_changes("major", "removed", removed),
            *_episode_changes("major", "with other frames", self.frames_changed),
            *_episode_changes("major", "with another number", self.renumbered),
            *_episode_changes("minor", "added", self.episodes_added),
            *_episode_changes("minor", "excluded or included again", self.exclusions_changed),
            *_episode_changes("patch", f"with other values of {', '.join(sorted(columns))}", metadata),
        ]
        return tuple(sorted(changes, key=lambda change: -BUMPS.index(change.bump)))

    def to_json(self) -> dict[str, Any]:
        """The fields for `--json`."""
        fields = asdict(self)
        return {**fields, "schema": [change.text for change in self.schema]}


def compare(before: Content, after: Content) -> Difference:
    """Compares two contents; episodes are matched by `episode_uuid`."""
    old = {episode.episode_uuid: (number, episode) for number, episode in enumerate(before.episodes)}
    new = {episode.episode_uuid: (number, episode) for number, episode in enumerate(after.episodes)}
    common = [uuid for uuid in new if uuid in old]
    common_features = before.features.keys() & after.features.keys()
    changed, frames = {}, []
    for uuid in common:
        a, b = old[uuid][1], new[uuid][1]
        features = _differing_keys(a.features, b.features, common_features)
        columns = _differing_keys(a.columns, b.columns, a.columns.keys() & b.columns.keys())
        if a.frames != b.frames:
            features.append("length")
        if features or columns:
            changed[uuid] = (*features, *columns)
        if features:
            frames.append(uuid)
    return Difference(
        schema=tuple(_schema_changes(before, after)),
        episodes_added=tuple(uuid for uuid in new if uuid not in old),
        episodes_removed=tuple(uuid for uuid in old if uuid not in new),
        episodes_changed=changed,
        renumbered=tuple(uuid for uuid in common if old[uuid][0] != new[uuid][0]),
        frames_changed=tuple(frames),
        exclusions_changed=tuple(uuid for uuid, names in changed.items() if EXCLUSION in names),
        withdrawn=tuple(uuid for uuid, (_, episode) in old.items() if uuid not in new and is_anonymous(episode)),
    )


def _schema_changes(before: Content, after: Content) -> Iterable[Change]:
    for name in ("fps", "robot_type"):
        a, b = getattr(before, name), getattr(after, name)
        if a != b:
            yield Change("major", f"{name}: {a} -> {b}")
    for name in sorted(before.features.keys() | after.features.keys()):
        a, b = before.features.get(name), after.features.get(name)
        if a is None or b is None:
            yield Change("major", f"feature {name} {'added' if a is None else 'removed'}")
        elif a != b:
            parts = (f"{key} {a.get(key)} -> {b.get(key)}" for key in sorted({*a, *b}) if a.get(key) != b.get(key))
            yield Change("major", f"feature {name}: {', '.join(parts)}")
    yield from _set_changes("task", before.tasks, after.tasks)
    if any(_columns(before.episodes)) and any(_columns(after.episodes)):
        yield from _set_changes("episode column", _columns(before.episodes), _columns(after.episodes))


def _set_changes(noun: str, before: Iterable[str], after: Iterable[str]) -> Iterable[Change]:
    for name in sorted(set(before) - set(after)):
        yield Change("major", f"{noun} {name!r} removed")
    for name in sorted(set(after) - set(before)):
        yield Change("minor", f"{noun} {name!r} added")


def _columns(episodes: tuple[EpisodeContent, ...]) -> Iterable[str]:
    return next((episode.columns for episode in episodes if episode.columns), {})  # the same in all


def _differing_keys(a: dict[str, str], b: dict[str, str], names: Iterable[str]) -> list[str]:
    return sorted(name for name in names if a.get(name) != b.get(name))


def _withdrawal_changes(count: int) -> Iterable[Change]:
    if count:
        yield Change("major", withdrawal_text(count))


def withdrawal_text(count: int) -> str:
    """The line of the change log for withdrawn episodes: their number, not their names."""
    noun = "episode" if count == 1 else "episodes"
    return f"{count} {noun} removed: withdrawn by people who took part"


def _episode_changes(bump: Bump, description: str, uuids: Iterable[str]) -> Iterable[Change]:
    uuids = list(uuids)
    if uuids:
        shown = ", ".join(uuids[:_MAX_SHOWN]) + (", ..." if len(uuids) > _MAX_SHOWN else "")
        yield Change(bump, f"{len(uuids)} {'episode' if len(uuids) == 1 else 'episodes'} {description}: {shown}")
