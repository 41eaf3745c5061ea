"""The card of a data set: Hub metadata in YAML, and a README with facts from the data set's metadata only."""

from collections.abc import Iterable

from huggingface_hub import DatasetCardData

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.lerobot_folder.exclusions import EXCLUDED_PREFIX
from copolicy.dataset.publication.licences import checked_licence, licence_identifier
from copolicy.dataset.publication.minimal_card import CONFIGS
from copolicy.dataset.publication.repo_id import checked_repo_id
from copolicy.dataset.scenarios import set_label
from copolicy.dataset.settings_text import count_settings
from copolicy.dataset.task_words import TaskWords

from .artefacts import newest_release
from .datasheet import datasheet
from .facts import DatasetFacts
from .findings import findings
from .formatting import count_text, missing_part_note, table
from .multimodality import multimodality

_UPSTREAM = (
    "Imported from files of the original program of Ng, Liu and Kennedy (RA-L 2023){} do not state who or what played."
)
_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))


_MAX_LISTED = 400  # episodes printed on the card; `copolicy-dataset exclude --list` prints a longer list


def source_text(source: str, words: TaskWords, page: bool = False) -> str:
    """Sentence on who played, for a card or the report page."""
    if source == "human":
        return "People played these episodes, two at a time, with one controller each."
    if source == "upstream":
        return _UPSTREAM.format(", which" if page else ". Those files")
    if source != "simulated":
        return f"Source: {source}."
    if page:
        opening, scope = "Simulated pairs: no person took part.", "on this page that includes them"
    else:
        opening, scope = "**No person took part.**", "made with these episodes"
    return f"{opening} {words.stand_in} No figure {scope} is a result about people."


def citation(words: TaskWords) -> list[str]:
    """The section that cites the paper of a task; empty if there is none."""
    return [f"## Citation\n\n{words.citation}\n\n```bibtex\n{words.paper}\n```"] if words.paper else []


def render_dataset_card(
    facts: DatasetFacts, repo_id: str, pretty_name: str | None = None, figures: Iterable[tuple[str, str]] = ()
) -> str:
    """Renders `README.md` of a data set.

    Args:
        repo_id: `user/name` of the data set, for the loading example.
        figures: path in the data set's folder and caption of each figure.

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
    """The YAML block for the Hub."""
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
    """Hub identifier of the licence of all episodes; `other` for several, `unknown` if an episode has none."""
    # Recordings may spell a licence differently.
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
                    (words.success, count_text(facts.successes, len(facts.episodes))),
                    ("physics", _physics(facts)),
                    ("format", f"LeRobot {info['codebase_version']}"),
                ),
            ),
        )
    )


def _physics(facts: DatasetFacts) -> str:
    try:
        counts = count_settings((episode["physics"] for episode in facts.episodes), facts.task)
    except InvalidValueError as error:
        raise FileFormatError(facts.root, "episodes with valid physics settings", str(error)) from None
    total = len(facts.episodes)
    return "; ".join(f"{physics} ({count} of {total} episodes)" for physics, count in counts.items())


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
            count_text(sum(e["success"] for e in members), len(members)),
        )
        for name, members in sorted(sets.items())
        if name
    ]
    reasons = [(reason, count_text(count, total)) for reason, count in facts.counts("termination_reason").items()]
    words, failures = facts.words, "Failures and time-outs are included and marked."
    if facts.task.offers("strategy"):
        failures += f" {words.label.capitalize()}s{words.labels[0] and f', {words.labels[0]}'}:"
        routes = [(label or "none", count) for label, count in facts.counts("route_class").items()]
        labels = [table((words.label, "episodes"), routes)]
    else:
        labels = [missing_part_note(facts.task, "strategy labels")]
    return "\n\n".join(
        (
            "## Episodes",
            table((f"{words.scenario} set", words.scenarios, "episodes", words.success), maps),
            table(("ended by", "episodes"), reasons),
            failures,
            *labels,
        )
    )


def _features(facts: DatasetFacts) -> str:
    rows = [
        (f"`{key}`", feature["dtype"], "x".join(map(str, feature["shape"])),
         ", ".join(map(str, names)) if isinstance(names := feature.get("names"), list) else "")
        for key, feature in facts.info["features"].items()
    ]  # fmt: skip
    return "\n\n".join(
        (
            "## Features",
            table(("key", "type", "shape", "names"), rows),
            f"{facts.words.numbers} An action is stored with the state in which it was taken; "
            "`observation.human_action` is the human's action of the previous frame.",
        )
    )


def _loading(facts: DatasetFacts, repo_id: str) -> str:
    release = newest_release(facts.root)
    revision = f', revision="data-{release["version"]}"' if release and "version" in release else ""
    return f"""## Loading and training

```python
from lerobot.datasets.lerobot_dataset import LeRobotDataset

dataset = LeRobotDataset("{repo_id}"{revision})  # or root="FOLDER" for a local copy
print(dataset.meta.episodes["pair_id"][0], dataset[0]["action"])
```

```bash
pip install 'lerobot_policy_copolicy[train]'
copolicy-train --policy.type=copolicy --dataset.repo_id={repo_id}
```"""


def _excluded(facts: DatasetFacts, repo_id: str) -> list[str]:
    """The section on excluded episodes, empty if there are none; `repo_id` is used in the examples."""
    discarded = [episode for episode in facts.episodes if episode.get("discarded")]
    if not discarded:
        return []
    included = [str(episode["episode_index"]) for episode in facts.episodes if not episode.get("discarded")]
    episodes = f"'[{','.join(included)}]'" if len(included) <= _MAX_LISTED else "LIST"
    rows = [(episode["episode_index"], _exclusion_reason(str(episode["quality_flags"] or ""))) for episode in discarded]
    return [
        f"""## Excluded episodes

{len(discarded)} of {len(facts.episodes)} episodes are stored but marked as excluded (column `discarded` of
`meta/episodes`):

{table(("episode", "reason"), rows)}

`copolicy-train` skips them. LeRobot ignores the mark: its trainer and loader use every episode unless a list is given
(`copolicy-dataset exclude FOLDER --list` prints it).

```bash
lerobot-train --dataset.repo_id={repo_id} --dataset.episodes={episodes} ...
```

```python
from lerobot.datasets import LeRobotDataset, LeRobotDatasetMetadata

discarded = LeRobotDatasetMetadata("{repo_id}").episodes["discarded"]
dataset = LeRobotDataset("{repo_id}", episodes=[k for k, flag in enumerate(discarded) if not flag])
```"""
    ]


def _exclusion_reason(flags: str) -> str:
    reasons = [flag.removeprefix(EXCLUDED_PREFIX) for flag in flags.split(",") if flag.startswith(EXCLUDED_PREFIX)]
    return reasons[0] if reasons else "discarded while recording"
