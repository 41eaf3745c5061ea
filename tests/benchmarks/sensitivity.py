"""How much the actions of policies on demonstrated frames depend on the table's velocity, and on its place.

    uv run python tests/benchmarks/sensitivity.py --dataset outputs/rivals/data/pairs-sim-376-orders \\
        --runs outputs/rivals/runs/bc-normalized-10hz/seed_0 outputs/rivals/runs/codp-h-paper-long/seed_0

Each policy observes whole demonstrations of the data set and predicts the next action at each frame (of a chunk the
first), with the same random numbers for each change. The table has the mean absolute error against the demonstrated
actions, and the mean absolute change of the prediction if the velocity reads 0, if the table is 20 px further in y, and
if it is turned by 30 degrees; for forces of [-1, 1]. Compare policies with each other: the changes are not of equal
size. The velocity tells the past actions, which a policy may copy.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before torch is imported

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from training_study import spread, training_run

from copolicy.dataset import DatasetEpisode, load_dataset
from copolicy.dataset.arrays import Array
from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.train.checkpoint import Checkpoint


def resting_states(states: Array) -> Array:
    """States `(..., 7)` of a table at rest."""
    changed = states.copy()
    changed[..., 4:] = 0
    return changed


def shifted_states(states: Array) -> Array:
    """States `(..., 7)` of a table 20 px further in y."""
    changed = states.copy()
    changed[..., 1] += 20
    return changed


def turned_states(states: Array) -> Array:
    """States `(..., 7)` of a table turned by 30 degrees."""
    changed, (cos, sin) = states.copy(), (math.cos(math.pi / 6), math.sin(math.pi / 6))
    changed[..., 2] = cos * states[..., 2] - sin * states[..., 3]
    changed[..., 3] = sin * states[..., 2] + cos * states[..., 3]
    return changed


STATE_CHANGES: Mapping[str, Callable[[Array], Array]] = {
    "velocity 0": resting_states,
    "20 px in y": shifted_states,
    "30 degrees": turned_states,
}


def predicted_actions(
    policy: Checkpoint, episodes: Sequence[DatasetEpisode], change: Callable[[Array], Array]
) -> Array:
    """The action `(N, 2 m)` that a policy predicts at each frame of the episodes, which it observes changed.

    Args:
        policy: at the rate of the episodes.
        change: of the states `(T, n)`.
    """
    policy.reset(0)
    policy.n_predicted_actions = 1
    lengths = np.array([len(episode) for episode in episodes])
    columns = {
        STATE: [change(episode.states) for episode in episodes],
        ENVIRONMENT_STATE: [
            np.tile(episode.task.scenario_vector(episode.scenario), (len(episode), 1)) for episode in episodes
        ],
        HUMAN_ACTION: [episode.past_human_actions for episode in episodes],
    }
    actions = [[] for _ in episodes]
    for frame in range(lengths.max()):
        # Before an episode its first frame is repeated, after it its last, whose actions are left out.
        history = np.clip(np.arange(frame - policy.n_obs_steps + 1, frame + 1), 0, lengths[:, None] - 1)
        observations = {
            name: np.stack([values[rows] for values, rows in zip(arrays, history, strict=True)])
            for name, arrays in columns.items()
        }
        for index, action in enumerate(policy.predict_action_chunk(observations)[:, 0]):
            if frame < lengths[index]:
                actions[index].append(action)
    return np.concatenate([np.array(rows) for rows in actions])


def main() -> None:
    """Prints a Markdown table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dataset", type=Path, required=True, help="demonstrations of the table")
    parser.add_argument("--runs", nargs="+", type=Path, required=True, help="training runs, at the data set's rate")
    parser.add_argument("--limit", type=int, default=94, help="number of episodes, spread evenly")
    arguments = parser.parse_args()
    dataset = load_dataset(arguments.dataset)
    if dataset.task.spec.name != "table":
        raise SystemExit(f"{arguments.dataset}: expected a data set of the table, found {dataset.task.spec.title}")
    episodes = spread(dataset.episodes, arguments.limit)
    demonstrated = np.concatenate([episode.actions for episode in episodes])
    mean_action = np.abs(demonstrated).mean()
    print(f"{len(episodes)} episodes, {len(demonstrated)} frames, mean absolute action {mean_action:.2f}\n")
    print(f"| run | error | {' | '.join(STATE_CHANGES)} |\n|---|---:|{'---:|' * len(STATE_CHANGES)}")
    for run in arguments.runs:
        policy = Checkpoint(training_run(run))
        if policy.fps != dataset.fps:
            raise SystemExit(f"{run}: expected a policy of {dataset.fps} Hz, the rate of the data, found {policy.fps}")
        unchanged = predicted_actions(policy, episodes, np.copy)
        differences = [demonstrated - unchanged]
        differences += [predicted_actions(policy, episodes, change) - unchanged for change in STATE_CHANGES.values()]
        cells = " | ".join(f"{np.abs(difference).mean():.3f}" for difference in differences)
        print(f"| {'/'.join(run.parts[-2:])} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
