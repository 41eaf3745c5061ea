"""The card of a data set: Hub metadata in YAML, and a README that states only what the data set's metadata holds."""

import re
from collections.abc import Iterable

from copolicy.dataset.exceptions import InvalidValueError, MissingExtraError

from .facts import DatasetFacts

try:
    from huggingface_hub import DatasetCardData
except ModuleNotFoundError:
    raise MissingExtraError("huggingface_hub") from None

_SOURCES = {
    "human": "People played these episodes, two at a time, with one controller each.",
    "simulated": (
        "**No person took part.** Two scripted pilots, one at each end of the table, stand in for people. "
        "No figure made with these episodes is a result about people."
    ),
    "upstream": (
        "Imported from files of the original program of Ng, Liu and Kennedy (RA-L 2023). "
        "Those files do not say who or what held the sticks."
    ),
}
_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))


def render(facts: DatasetFacts, repo_id: str, pretty_name: str | None = None) -> str:
    """The text of `README.md` for a data set.

    Args:
        repo_id: `user/name` of the data set, for the loading example.

    Raises:
        InvalidValueError: `repo_id` or a licence is not in the Hub's form.
    """
    if not re.fullmatch(r"[\w.-]+/[\w.-]+", repo_id):
        raise InvalidValueError("--repo-id", "user/name in letters, digits, '-', '_' and '.'", repo_id)
    title = pretty_name or repo_id.split("/")[1]
    sections = (
        _overview(facts, title),
        _collection(facts),
        _episodes(facts),
        _features(facts),
        _loading(facts, repo_id),
        _licence_text(facts),
    )
    return f"---\n{hub_metadata(facts, title).to_yaml()}\n---\n\n" + "\n\n".join(sections) + "\n"


def hub_metadata(facts: DatasetFacts, title: str) -> DatasetCardData:
    """The YAML block that the Hub reads."""
    sources = facts.values("source")
    return DatasetCardData(
        license=_licence(facts),
        task_categories=["robotics"],
        tags=["LeRobot", "copolicy", "human-robot-collaboration", "table-carrying", *sources],
        size_categories=[next((name for limit, name in _SIZES if facts.info["total_frames"] < limit), "1M<n<10M")],
        pretty_name=title,
        configs=[{"config_name": "default", "data_files": "data/*/*.parquet"}],
    )


def _licence(facts: DatasetFacts) -> str:
    """The Hub's identifier: the one licence of all episodes, `other` for several, `unknown` where one has none."""
    licences = facts.counts("license")
    if "" in licences:
        return "unknown"
    if len(licences) > 1:
        return "other"
    licence = next(iter(licences)).lower()
    if not re.fullmatch(r"[a-z0-9][a-z0-9.-]*", licence):
        raise InvalidValueError("license", "a Hub licence identifier such as cc-by-4.0", licence)
    return licence


def _overview(facts: DatasetFacts, title: str) -> str:
    info = facts.info
    sources = [_SOURCES.get(source, f"Source: {source}.") for source in facts.values("source")]
    return "\n\n".join(
        (
            f"# {title}",
            "Two players carry a table past obstacles to a goal: states and the joint action of both, "
            "for learning policies that carry *with* a person.",
            *sources,
            _table(
                ("", ""),
                (
                    ("episodes", info["total_episodes"]),
                    ("frames", f"{info['total_frames']:,}"),
                    ("rate of the frames", f"{info['fps']:g} Hz"),
                    ("recorded time", f"{facts.seconds / 60:.1f} min"),
                    ("reached the goal", _share(facts.successes, len(facts.episodes))),
                    ("format", f"LeRobot {info['codebase_version']}"),
                ),
            ),
        )
    )


def _collection(facts: DatasetFacts) -> str:
    lines = ["## Who played, and how it was recorded", ""]
    for label, column in (
        ("Source", "source"),
        ("Pairs (pseudonyms)", "pair_id"),
        ("Controller of the robot seat", "controller_0"),
        ("Controller of the human seat", "controller_1"),
        ("Software", "software_version"),
    ):
        counts = facts.counts(column)
        text = ", ".join(f"{value or 'not stated'} ({count})" for value, count in list(counts.items())[:12])
        more = f", and {len(counts) - 12} more" if len(counts) > 12 else ""
        lines.append(f"- {label}: {text}{more}")
    consents = sum(bool(episode["consent_id"]) for episode in facts.episodes)
    people = any(episode["source"] == "human" for episode in facts.episodes)
    lines.append(f"- Consent: {_share(consents, len(facts.episodes))} episodes name a consent record" if people else "")
    flagged = {flag: n for flag, n in facts.counts("quality_flags").items() if flag}
    text = ", ".join(f"`{flag}` ({count})" for flag, count in flagged.items())
    lines.append(f"- Quality flags: {text or 'none set'}")
    drift = [episode["replay_drift_px"] for episode in facts.episodes]
    known = [value for value in drift if value is not None and value == value]
    if known:
        lines.append(f"- Recorded against re-simulated position: at most {max(known):.3g} px apart")
    return "\n".join(line for index, line in enumerate(lines) if line or index == 1)


def _episodes(facts: DatasetFacts) -> str:
    total = len(facts.episodes)
    maps = [
        (name, len({e["map_id"] for e in members}), len(members), _share(sum(e["success"] for e in members)))
        for name in facts.values("map_set")
        if (members := [e for e in facts.episodes if e["map_set"] == name])
    ]
    reasons = [(reason, _share(count, total)) for reason, count in facts.counts("termination_reason").items()]
    routes = [(route or "none", count) for route, count in facts.counts("route_class").items()]
    return "\n\n".join(
        (
            "## Episodes",
            _table(("map set", "maps", "episodes", "reached the goal"), maps),
            _table(("ended by", "episodes"), reasons),
            "Failures and time-outs are kept and marked. Routes, one letter an obstacle (L: the table passed below "
            "it on screen, R: above it):",
            _table(("route", "episodes"), routes),
        )
    )


def _features(facts: DatasetFacts) -> str:
    rows = [
        (f"`{key}`", feature["dtype"], "x".join(map(str, feature["shape"])), ", ".join(_names(feature)))
        for key, feature in facts.info["features"].items()
    ]
    return "\n\n".join(
        (
            "## Features",
            _table(("key", "type", "shape", "names"), rows),
            "Positions are px in a window of 1200 x 600, y down; angles rad, counter-clockwise on screen; forces in "
            "units of a player's full force. An action is stored with the state it was taken in; "
            "`observation.human_action` is the human's action of the frame before.",
        )
    )


def _loading(facts: DatasetFacts, repo_id: str) -> str:
    return f"""## How to load it

```python
from lerobot.datasets.lerobot_dataset import LeRobotDataset

dataset = LeRobotDataset("{repo_id}")  # or root="FOLDER" for a local copy
print(dataset.meta.episodes["pair_id"][0], dataset[0]["action"])
```

Train a co-policy on it: `copolicy-train --policy.type=copolicy --dataset.repo_id={repo_id}`"""


def _licence_text(facts: DatasetFacts) -> str:
    licences = facts.counts("license")
    rows = ", ".join(f"{name or 'not stated'} ({count} episodes)" for name, count in licences.items())
    return f"## Licence\n\n{rows}"


def _names(feature: dict) -> Iterable[str]:
    names = feature.get("names")
    return names if isinstance(names, list) else ()


def _share(count: int, total: int | None = None) -> str:
    return str(count) if total is None else f"{count} of {total} ({100 * count / max(1, total):.1f} %)"


def _table(header: Iterable[object], rows: Iterable[Iterable[object]]) -> str:
    head = list(header)
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |" for line in lines)
