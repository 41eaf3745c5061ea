"""What a consumer of a data set must know of the episodes that it marks as excluded."""

from .facts import DatasetFacts
from .markdown import table

_REASON = "excluded: "
_LISTED = 400  # episodes; a longer list is for a command to print


def excluded(facts: DatasetFacts, repo_id: str) -> list[str]:
    """The section on excluded episodes, where there are any; none otherwise.

    Args:
        repo_id: `user/name` of the data set, for the examples.
    """
    marked = [episode for episode in facts.episodes if episode.get("discarded")]
    if not marked:
        return []
    included = [str(episode["episode_index"]) for episode in facts.episodes if not episode.get("discarded")]
    named = f"'[{','.join(included)}]'" if len(included) <= _LISTED else "LIST"
    rows = [(episode["episode_index"], _reason(str(episode.get("quality_flags") or ""))) for episode in marked]
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


def _reason(flags: str) -> str:
    reasons = [flag.removeprefix(_REASON) for flag in flags.split(",") if flag.startswith(_REASON)]
    return reasons[0] if reasons else "discarded while recording"
