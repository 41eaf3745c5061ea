"""Facts about a policy's training data, from the data set's metadata or the recipe of an exported policy."""

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Any

from copolicy.dataset.scenarios import set_label

from .facts import DatasetFacts

_COUNTS = {"sources": "source", "map_sets": "map_set", "licences": "license", "pairs": "pair_id"}
"""Fields with numbers of episodes, by the column and recipe key that they come from."""


@dataclass(frozen=True)
class TrainingData:
    """Facts about a policy's training data; None or empty where not stated.

    Attributes:
        used: number of episodes used in training.
        episodes: number of episodes in the data set.
        sources: number of episodes by source (`human`, `simulated`, `upstream`); likewise map sets, licences and pairs.
    """

    repo_id: str
    revision: str | None
    used: int | None
    episodes: int | None = None
    frames: int | None = None
    fps: float | None = None
    version: str | None = None
    content_hash: str | None = None
    sources: dict[str, int] = field(default_factory=dict)
    map_sets: dict[str, int] = field(default_factory=dict)
    licences: dict[str, int] = field(default_factory=dict)
    pairs: dict[str, int] = field(default_factory=dict)

    @property
    def described(self) -> bool:
        """Whether more than the name of the data set is known."""
        return bool(self.sources)

    @classmethod
    def from_data_set(cls, facts: DatasetFacts, settings: dict[str, Any]) -> "TrainingData":
        """Reads the facts from the data set's folder and the dataset settings of the training."""
        sets = Counter(set_label(episode) for episode in facts.episodes)
        stated = cls.from_settings(settings)
        return replace(
            stated,
            used=len(facts.episodes) if stated.used is None else stated.used,
            episodes=len(facts.episodes),
            frames=facts.info["total_frames"],
            fps=facts.info["fps"],
            sources=facts.counts("source"),
            map_sets=dict(sorted(sets.items(), key=lambda item: (-item[1], item[0]))),
            licences=facts.counts("license"),
            pairs=facts.counts("pair_id"),
        )

    @classmethod
    def from_settings(cls, settings: dict[str, Any], fps: float | None = None) -> "TrainingData":
        """Reads the facts from the dataset settings of the training, if the data set is not available."""
        chosen = settings.get("episodes")
        used = None if chosen is None else len(chosen)
        return cls(str(settings.get("repo_id") or ""), settings.get("revision"), used, fps=fps)

    @classmethod
    def from_recipe(cls, recipe: dict[str, Any]) -> "TrainingData":
        """Reads the facts from the entry `dataset` of `recipe.json`."""
        stated: dict[str, Any] = {name: recipe.get(key) or {} for name, key in _COUNTS.items()}
        stated |= {name: recipe.get(name) for name in ("episodes", "frames", "fps", "version", "content_hash")}
        name, revision = str(recipe.get("repo_id") or ""), recipe.get("revision")
        return cls(name, revision, recipe.get("episodes_used"), **stated)
