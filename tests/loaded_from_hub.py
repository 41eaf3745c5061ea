"""A command for `HubUser`: LeRobot loads revisions of a data set of the Hub, and one line says what each holds.

main(["lab/table", "data-1.0.0", ""])    an empty revision is that which LeRobot chooses
"""

from typing import Any

from copolicy.dataset.versions.content import read_content


def main(arguments: list[str]) -> int:
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    repo_id, *revisions = arguments
    for revision in revisions:
        dataset: Any = LeRobotDataset(repo_id, revision=revision or None)
        print(read_content(dataset.root).hash, dataset.num_frames, dataset[0]["action"].shape)
    return 0
