"""The card of a data set: Hub metadata in YAML, and a README that states only what the data set's metadata holds."""

from collections.abc import Iterable

from huggingface_hub import DatasetCardData

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.lerobot_folder.exclusions import EXCLUDED_PREFIX
from copolicy.dataset.physics_text import physics_counts
from copolicy.dataset.publication.licences import checked_licence, licence_identifier
from copolicy.dataset.publication.minimal_card import CONFIGS
from copolicy.dataset.publication.repo_id import checked_repo_id
from copolicy.dataset.scenarios import set_label
from copolicy.dataset.task_words import TaskWords

from .artefacts import newest_release
from .datasheet import datasheet
from .facts import DatasetFacts
from .findings import findings
from .markdown import left_out, share, table
from .multimodality import multimodality

_UPSTREAM = (
    "Imported from files of the original program of Ng, Liu and Kennedy (RA-L 2023){} do not say who or what held the "
    "sticks."
)
_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))


_LISTED = 400  # episodes; a longer list is for a command to print


def source_text(source: str, words: TaskWords, page: bool = False) -> str:
    """Who played, on a card or on the page."""
    if source == "human":
        return "People played these episodes, two at a time, with one controller each."
    if source == "upstream":
        return _UPSTREAM.format(", which" if page else ". Those files")
    if source != "simulated":
        return f"Source: {source}."
    if page:
        before, about = "Simulated pairs: no person took part.", "on this page that includes them"
    else:
        before, about = "**No person took part.**", "made with these episodes"
    return f"{before} {words.stand_in} No figure {about} is a result about people."


def citation(words: TaskWords) -> list[str]:
    """The section on the paper behind a task, where there is one."""
    return [f"## Citation\n\n{words.citation}\n\n```bibtex\n{words.paper}\n```"] if words.paper else []


def render(
    facts: DatasetFacts, repo_id: str, pretty_name: str | None = None, figures: Iterable[tuple[str, str]] = ()
) -> str:
    """The text of `README.md` for a data set.

    Args:
        repo_id: `user/name` of the data set, for the loading example.
        figures: path in the data set's folder and caption of each picture.

    Raises:
        InvalidValueError: `repo_id` or a licence is not in the Hub's form.
        FileFormatError: statistics, findings, release or another file in `meta/` cannot be read.
    """
    checked_repo_id(repo_id)
    title = pretty_name or repo_id.split("/")[1]
    sections = (
        _overview(facts, title),
        *(f"![{caption}]({path})\n\n*{caption}*" for path, caption in figures),
        *([] if facts.task.outline else [f"Figures of paths: {facts.task.missing('outline')}."]),
        _loading(facts, repo_id),
        *_excluded(facts, repo_id),
        _episodes(facts),
        multimodality(facts),
        findings(facts),
        _features(facts),
        *datasheet(facts),
        *citation(facts.words),
    )
    return f"---\n{hub_metadata(facts, title).to_yaml()}\n---\n\n" + "\n\n".join(sections) + "\n"


def hub_metadata(facts: DatasetFacts, title: str) -> DatasetCardData:
    """The YAML block that the Hub reads."""
    sources = facts.values("source")
    return DatasetCardData(
        license=licence(facts),
        task_categories=["robotics"],
        tags=["LeRobot", "copolicy", "human-robot-collaboration", facts.words.tag, *sources],
        size_categories=[next((name for limit, name in _SIZES if facts.info["total_frames"] < limit), "1M<n<10M")],
        pretty_name=title,
        configs=[{"config_name": name, "data_files": files} for name, files in CONFIGS],
    )


def licence(facts: DatasetFacts) -> str:
    """The Hub's identifier: the one licence of all episodes, `other` for several, `unknown` where one has none."""
    # Recordings may have been made where nobody looked at the spelling.
    licences = {licence_identifier(text) or text for text in facts.counts("license")}
    if "" in licences:
        return "unknown"
    if len(licences) > 1:
        return "other"
    return checked_licence(next(iter(licences)), "license")


def _overview(facts: DatasetFacts, title: str) -> str:
    info, words = facts.info, facts.words
    return "\n\n".join(
        (
            f"# {title}",
            f"{words.about}: states and the joint action of both, for learning policies that {words.act} *with* a "
            "person.",
            *(source_text(source, words) for source in facts.values("source")),
            table(
                ("", ""),
                (
                    ("episodes", info["total_episodes"]),
                    ("frames", f"{info['total_frames']:,}"),
                    ("rate of the frames", f"{info['fps']:g} Hz"),
                    ("recorded time", f"{facts.seconds / 60:.1f} min"),
                    (words.success, share(facts.successes, len(facts.episodes))),
                    ("physics", _physics(facts)),
                    ("format", f"LeRobot {info['codebase_version']}"),
                ),
            ),
        )
    )


def _physics(facts: DatasetFacts) -> str:
    try:
        counts = physics_counts((episode["physics"] for episode in facts.episodes), facts.task)
    except InvalidValueError as error:
        raise FileFormatError(facts.root, "episodes whose settings of the dynamics can be read", str(error)) from None
    total = len(facts.episodes)
    return "; ".join(f"{words} ({count} of {total} episodes)" for words, count in counts.items())


def _episodes(facts: DatasetFacts) -> str:
    total = len(facts.episodes)
    sets: dict[str, list[dict]] = {}
    for episode in facts.episodes:
        sets.setdefault(set_label(episode), []).append(episode)
    maps = [
        (
            name,
            len({e["map_id"] for e in members}),
            len(members),
            share(sum(e["success"] for e in members), len(members)),
        )
        for name, members in sorted(sets.items())
        if name
    ]
    reasons = [(reason, share(count, total)) for reason, count in facts.counts("termination_reason").items()]
    words, kept = facts.words, "Failures and time-outs are kept and marked."
    if facts.task.offers("strategy"):
        kept += f" {words.label.capitalize()}s{words.labels[0] and f', {words.labels[0]}'}:"
        routes = [(label or "none", count) for label, count in facts.counts("route_class").items()]
        labels = [table((words.label, "episodes"), routes)]
    else:
        labels = [left_out(facts.task, "strategy labels")]
    return "\n\n".join(
        (
            "## Episodes",
            table((f"{words.scenario} set", words.scenarios, "episodes", words.success), maps),
            table(("ended by", "episodes"), reasons),
            kept,
            *labels,
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
            table(("key", "type", "shape", "names"), rows),
            f"{facts.words.numbers} An action is stored with the state it was taken in; "
            "`observation.human_action` is the human's action of the frame before.",
        )
    )


def _loading(facts: DatasetFacts, repo_id: str) -> str:
    release = newest_release(facts.root)
    revision = f', revision="data-{release["version"]}"' if release and "version" in release else ""
    return f"""## How to load it, and how to train on it

```python
from lerobot.datasets.lerobot_dataset import LeRobotDataset

dataset = LeRobotDataset("{repo_id}"{revision})  # or root="FOLDER" for a local copy
print(dataset.meta.episodes["pair_id"][0], dataset[0]["action"])
```

```bash
pip install 'lerobot_policy_copolicy[train]'
copolicy-train --policy.type=copolicy --dataset.repo_id={repo_id}
```"""


def _names(feature: dict) -> Iterable[str]:
    names = feature.get("names")
    return map(str, names) if isinstance(names, list) else ()


def _excluded(facts: DatasetFacts, repo_id: str) -> list[str]:
    """The section on excluded episodes, where there are any; none otherwise.

    Args:
        repo_id: `user/name` of the data set, for the examples.
    """
    marked = [episode for episode in facts.episodes if episode.get("discarded")]
    if not marked:
        return []
    included = [str(episode["episode_index"]) for episode in facts.episodes if not episode.get("discarded")]
    named = f"'[{','.join(included)}]'" if len(included) <= _LISTED else "LIST"
    rows = [(episode["episode_index"], _why(str(episode.get("quality_flags") or ""))) for episode in marked]
    return [
        f"""## Excluded episodes

{len(marked)} of {len(facts.episodes)} episodes are kept and marked as not to be used (column `discarded` of
`meta/episodes`):

{table(("episode", "why"), rows)}

`copolicy-train` leaves them out. LeRobot knows no such mark: its own trainer and loader take every episode unless they
are told which ones (`copolicy-dataset exclude FOLDER --list` prints the list).

```bash
lerobot-train --dataset.repo_id={repo_id} --dataset.episodes={named} ...
```

```python
from lerobot.datasets import LeRobotDataset, LeRobotDatasetMetadata

marked = LeRobotDatasetMetadata("{repo_id}").episodes["discarded"]
dataset = LeRobotDataset("{repo_id}", episodes=[k for k, mark in enumerate(marked) if not mark])
```"""
    ]


def _why(flags: str) -> str:
    reasons = [flag.removeprefix(EXCLUDED_PREFIX) for flag in flags.split(",") if flag.startswith(EXCLUDED_PREFIX)]
    return reasons[0] if reasons else "discarded while recording"
