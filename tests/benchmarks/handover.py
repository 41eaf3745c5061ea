"""Drift of a policy: co-planning that takes over from a demonstration at different places of its way.

    uv run python tests/benchmarks/handover.py --runs outputs/rivals/runs/bc/seed_* --recordings FOLDER --out bc.json

Each world repeats a recorded demonstration, exactly, until the table's centre has come to `--places` (px along the
map); from there the policy, which has observed the demonstration up to then, acts for both players. Beside it the
policy acts from the start. A policy that passes an obstacle from the demonstrated state before it, and touches it after
its own way to it, fails by the states into which it brings itself. The recordings are of the training data (simulated
pairs): their layouts are known to the policy. Runs differ in their training seed; differences have standard errors over
maps (bootstrap).
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before torch is imported

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.collect.agents import PolicyAgent
from copolicy.collect.episodes import run_episodes
from copolicy.dataset import read_episode
from copolicy.dataset.arrays import Array
from copolicy.dataset.episode import Episode
from copolicy.dataset.task import get_task
from copolicy.evaluate.notebook import compare_episodes, success
from copolicy.train.checkpoint import Checkpoint

PLACES = (330.0, 540.0)
"""px: 150 before the first and 180 before the second column of obstacles of the original maps, at 480 and 720."""


class HandoverAgent(PolicyAgent):
    """Repeats recorded joint actions for some steps of each world, then executes the policy's.

    Args:
        policy: acts after that; it observes all states and executed actions.
        actions: `(T, 2 m)` recorded joint actions of each world.
        steps: how many of them are repeated in each world.
    """

    def __init__(self, policy: Checkpoint, actions: Sequence[Array], steps: Sequence[int], **kwargs: Any):
        super().__init__(policy, **kwargs)
        self._actions, self._steps = actions, steps

    def half(self, seat: int, worlds: Array) -> Array:
        """A seat's half `(B, m)` of the recorded or the policy's joint actions."""
        half, columns = super().half(seat, worlds), slice(seat * self._size, (seat + 1) * self._size)
        for row, world in enumerate(worlds):
            if self._step < self._steps[world]:
                half[row] = self._actions[world][self._step, columns]
        return half


def continued(policy: Checkpoint, recordings: Sequence[Episode], place: float) -> list[Episode]:
    """Co-planning of the recordings' scenarios, taken over where the table's centre first is at `place`, px."""
    task = get_task(policy.task)
    policy.n_action_steps = policy.n_predicted_actions = min(8, policy.chunk_size)
    settings = replace(policy.conditions.settings, step_limit=task.studies.step_limit)
    steps = [int(np.argmax(recording.states[:, 0] >= place)) for recording in recordings]
    agent = HandoverAgent(policy, [recording.actions for recording in recordings], steps, seed=0)
    return run_episodes(agent, None, [recording.scenario for recording in recordings], settings=settings)


def obstacle_failures(episodes: Sequence[Episode], place: float) -> dict[str, tuple[int, int]]:
    """Failures of the episodes, and their number, at each column of obstacles that lies beyond `place`.

    Counted are maps with an obstacle in the column. The first column is failed by an episode that ends before it, the
    second by one that ends beyond `PLACES[1]`.
    """
    counts = {}
    for column, reached in ((480, 0.0), (720, PLACES[1])):
        there = [
            episode
            for episode in episodes
            if any(round(x) == column for x, _ in episode.scenario.obstacles) and episode.states[:, 0].max() >= reached
        ]
        failed = [not episode.meta.success and (column == 720 or episode.final_state[0] < 480) for episode in there]
        if place < column:
            counts[f"column at {column} px"] = (int(sum(failed)), len(there))
    return counts


def main() -> None:
    """Evaluates, prints a Markdown table and writes the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", nargs="+", type=Path, required=True, help="training runs of one method")
    parser.add_argument("--recordings", type=Path, required=True, help="folder with the demonstrations (MCAP)")
    parser.add_argument("--out", type=Path, required=True, help="file (JSON) for the results")
    parser.add_argument("--places", nargs="+", type=float, default=list(PLACES), help="px along the map")
    parser.add_argument("--limit", type=int, default=94, help="recordings, spread evenly")
    arguments = parser.parse_args()
    files = sorted(arguments.recordings.glob("*.mcap"))
    if not files:
        raise SystemExit(f"{arguments.recordings}: expected recordings (*.mcap), found none")
    chosen = np.linspace(0, len(files) - 1, min(arguments.limit, len(files))).astype(int)
    recordings = [recording for recording in (read_episode(files[index]) for index in chosen) if recording.meta.success]
    runs = [run / "training" if (run / "training").exists() else run for run in arguments.runs]
    result: dict[str, Any] = {"runs": len(runs), "demonstrations": len(recordings), "places": {}}
    print("| policy from | success, % | difference | failed at 480 px | failed at 720 px |\n|---|---:|---:|---:|---:|")
    unchanged: list[Episode] = []
    for place in (0.0, *arguments.places):
        episodes = [episode for run in runs for episode in continued(Checkpoint(run), recordings, place)]
        rate, failures = success(episodes)["mean"], obstacle_failures(episodes, place)
        entry = result["places"][f"{place:g}"] = {"success": rate, "failures": failures}
        counts = [failures.get(f"column at {column} px") for column in (480, 720)]
        cells = ["", *("" if count is None else f"{count[0]} of {count[1]}" for count in counts)]
        if unchanged:
            entry["difference"] = difference = compare_episodes(episodes, unchanged)["success"]
            cells[0] = f"{100 * difference['mean']:+.1f} ± {100 * difference['standard_error']:.1f}"
        unchanged = unchanged or episodes
        print(f"| {f'{place:g} px' if place else 'the start'} | {100 * rate:.1f} | {' | '.join(cells)} |", flush=True)
    arguments.out.write_text(json.dumps(result, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
