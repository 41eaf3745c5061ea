"""`training_data.json` of a checkpoint: the pairs, people and episodes that a policy learned from. Needs no torch."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import CopolicyError
from copolicy.dataset.files.json_file import read_optional_json
from copolicy.dataset.files.meta_files import INFO_FILE, RELEASE_FILE
from copolicy.dataset.files.staging import replace_json
from copolicy.dataset.lerobot_folder.folder import LeRobotFolder
from copolicy.dataset.policies.documents import RecipeDocument, TrainingDataDocument, TrainingDocument
from copolicy.dataset.versions.content import read_content

TRAINING_DATA_FILE = "training_data.json"
UNNAMED = "(unnamed)"
"""Stands for the pairs of episodes without a `pair_id`."""

_PAIR, _SOURCE, _PEOPLE, _SIMULATED = "pair_id", "source", ("player_0_id", "player_1_id"), "simulated"


@dataclass(frozen=True)
class TrainingPairs:
    """Pairs that a policy learned from.

    Attributes:
        pairs: values of the episode column `pair_id`, `UNNAMED` for an empty one.
        people: pseudonyms of both players of all episodes that are not simulated.
        simulated: all episodes are simulated, so that equal names are the same scripted players in any data set.
        repo_id: name of the data set; None if not recorded.
        content_hash: of the data set; None if not recorded.
    """

    pairs: frozenset[str]
    people: frozenset[str]
    simulated: bool
    repo_id: str | None = None
    content_hash: str | None = None

    def shared_with(self, other: "TrainingPairs") -> list[str]:
        """Sorted names of pairs and people in both, if they are known or likely to be the same.

        Equal names are the same pair if both data sets are simulated, have the same content hash or the same name, or
        if a data set has no recorded name. Otherwise they may be different pairs of different labs.
        """
        same_data = self.content_hash is not None and self.content_hash == other.content_hash
        same_name = None in (self.repo_id, other.repo_id) or self.repo_id == other.repo_id
        if not (same_data or same_name or (self.simulated and other.simulated)):
            return []
        return sorted((self.pairs & other.pairs) | (self.people & other.people))


def training_pairs(folder: Path) -> TrainingPairs | None:
    """The pairs that the policy in a checkpoint's folder learned from.

    Read from `training_data.json`, else from the recipe of an exported policy, else from the data set that
    `train_config.json` names, if it is on this machine.

    Returns:
        None if none of these states them.

    Raises:
        FileFormatError: one of the files cannot be read.
    """
    own = read_optional_json(folder / TRAINING_DATA_FILE, TrainingDataDocument, "the data of a training")
    if own is None:
        recipe = read_optional_json(folder / "recipe.json", RecipeDocument, "the recipe of an exported policy") or {}
        data = recipe.get("dataset") or {}
        if data.get(_PAIR):
            own = {
                **data, "pairs": data[_PAIR], "sources": list(data.get(_SOURCE) or ()),
                "people": data.get("people") or [],
            }  # fmt: skip
    if own is None:
        settings = read_optional_json(folder / "train_config.json", TrainingDocument, "the settings of a training")
        source = (settings or {}).get("dataset") or {}
        root = Path(source.get("root") or "")
        if source.get("root") and (root / INFO_FILE).is_file():
            own = _facts(root, source.get("episodes"), source.get("repo_id"), None)
    if not own or not own.get("pairs"):
        return None
    names = frozenset(name or UNNAMED for name in own["pairs"])
    simulated = set(own.get("sources") or ()) == {_SIMULATED}
    people = frozenset(own.get("people") or ())
    return TrainingPairs(names, people, simulated, own.get("repo_id"), own.get("content_hash"))


def write_training_data(folder: Path, facts: dict[str, Any]) -> None:
    """Writes `training_data.json` into the folder of a checkpoint's policy."""
    replace_json(folder / TRAINING_DATA_FILE, facts)


def training_data(root: Path, episodes: list[int] | None, repo_id: str | None, split: str | None) -> dict[str, Any]:
    """The content of `training_data.json`: data set with its content hash, split, episodes, pairs and people.

    Args:
        root: folder of the data set.
        episodes: those of the run; all if None.
        split: value of `--split`.

    Returns:
        Empty for a data set without the episode column `pair_id`.
    """
    facts = _facts(root, episodes, repo_id, split)
    if not facts:
        return {}
    release = read_optional_json(root / RELEASE_FILE, dict[str, Any], "the record of a release") or {}
    content_hash = release.get("content_hash")
    if content_hash is None:
        try:
            content_hash = read_content(root).hash
        except CopolicyError:  # a data set that has no content hash, such as one without `episode_uuid`
            content_hash = None
    return {**facts, "content_hash": content_hash}


def _facts(root: Path, episodes: list[int] | None, repo_id: str | None, split: str | None) -> dict[str, Any]:
    columns = LeRobotFolder.open(root).episodes
    if _PAIR not in columns.column_names:
        return {}
    used = list(range(columns.num_rows)) if episodes is None else [int(episode) for episode in episodes]
    values = {
        name: columns.column(name).to_pylist()
        for name in (_PAIR, _SOURCE, *_PEOPLE)
        if name in columns.column_names
    }  # fmt: skip
    sources = [values.get(_SOURCE, [""] * columns.num_rows)[episode] or "" for episode in used]
    people = {
        values[name][episode]
        for name in _PEOPLE
        if name in values
        for episode, source in zip(used, sources, strict=True)
        if source != _SIMULATED
    }
    return {
        "repo_id": repo_id,
        "split": split,
        "pairs": dict(sorted(Counter(values[_PAIR][episode] or "" for episode in used).items())),
        "people": sorted(name for name in people if name),
        "sources": sorted(set(sources)),
        "episodes": used,
    }
