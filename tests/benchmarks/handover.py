"""Co-planning that goes on from a demonstration: whether a policy fails by the way on which it came to an obstacle.

    uv run python tests/benchmarks/handover.py --runs outputs/rivals/runs/bc-scan-10hz/seed_* \\
        --recordings outputs/rivals/data/pairs-sim-376-recordings --datasets outputs/rivals/data/pairs-sim-376 \\
        --out bc.json

Each world repeats a recorded demonstration until the table's centre is first at a given x. From there the policy, which
has observed the demonstration up to then, acts for both players; of an action chunk that it predicted before, it
executes the rest. Beside it the policy acts from the start. A policy that fails after its own way to an obstacle, and
not after a demonstrated one, fails by the states into which it brings itself, or, on maps whose demonstrations take
several routes (see routes_and_success.py), by a choice that the demonstration has made for it: most have by then.

The recordings are of the training data (simulated pairs), so the policy knows their maps. Runs differ in their training
seed; differences have standard errors over maps (bootstrap).
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before torch is imported

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from routes_and_success import ONE_ROUTE, MapKey, commonest_routes, map_key
from training_study import spread, training_run

from copolicy.collect.agents import PolicyAgent
from copolicy.collect.episodes import run_episodes
from copolicy.dataset import read_episode
from copolicy.dataset.arrays import Array
from copolicy.dataset.episode import Episode
from copolicy.dataset.task import get_task
from copolicy.evaluate.notebook import compare_episodes, success
from copolicy.train.checkpoint import Checkpoint

HANDOVER_X = (330.0, 540.0)
"""px: 150 before the first and 180 before the second column of obstacles; half the table is 96 px long."""
COLUMNS = (480, 720)
"""px: x of all obstacles of the original maps."""


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


def continued(policy: Checkpoint, recordings: Sequence[Episode], handover_x: float) -> list[Episode]:
    """Co-planning of the recordings' scenarios, from where the table's centre first is at `handover_x`, px.

    Raises:
        SystemExit: a recording does not come so far, or is of a world with other settings than the policy's data.
    """
    task = get_task(policy.task)
    policy.n_action_steps = policy.n_predicted_actions = min(8, policy.chunk_size)
    settings = replace(policy.conditions.settings, step_limit=task.studies.step_limit)
    steps: list[int] = []
    for recording in recordings:
        reached = recording.states[:, 0] >= handover_x
        if not reached.any():
            raise SystemExit(
                f"expected recordings in which the table comes to x = {handover_x:g} px, found one without"
            )
        if replace(recording.settings, step_limit=settings.step_limit) != settings:
            raise SystemExit("expected recordings of the world of the policy's data, found one with other settings")
        steps.append(int(np.argmax(reached)))
    agent = HandoverAgent(policy, [recording.actions for recording in recordings], steps, seed=0)
    return run_episodes(agent, None, [recording.scenario for recording in recordings], settings=settings)


def touched(episodes: Sequence[Episode], column: int, from_x: float) -> tuple[int, int]:
    """Number of episodes that end at an obstacle of a column, of those that have one there and come to `from_x`."""
    there = [
        episode
        for episode in episodes
        if any(round(x) == column for x, _ in episode.scenario.obstacles) and episode.states[:, 0].max() >= from_x
    ]
    return sum(_touched_column(episode) == column for episode in there), len(there)


def _touched_column(episode: Episode) -> int | None:
    """Column of the obstacle that ended an episode: the nearest; None if none did."""
    if episode.meta.termination_reason != "collision_obstacle":
        return None
    centres = np.array(episode.scenario.obstacles)
    nearest = np.argmin(np.linalg.norm(centres - episode.final_state[:2], axis=1))
    return round(float(centres[nearest, 0]))


def main() -> None:
    """Evaluates, prints a Markdown table and writes the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", nargs="+", type=Path, required=True, help="training runs of one method")
    parser.add_argument("--recordings", type=Path, required=True, help="folder with the demonstrations (MCAP)")
    parser.add_argument("--datasets", nargs="+", type=Path, required=True, help="demonstrations that count the routes")
    parser.add_argument("--out", type=Path, required=True, help="file (JSON) for the results")
    parser.add_argument("--limit", type=int, default=94, help="number of recordings, spread evenly")
    arguments = parser.parse_args()
    files = sorted(arguments.recordings.glob("*.mcap"))
    if not files:
        raise SystemExit(f"{arguments.recordings}: expected recordings (*.mcap), found none")
    chosen = map(read_episode, spread(files, arguments.limit))
    recordings = [recording for recording in chosen if recording.meta.success]
    runs = [training_run(run) for run in arguments.runs]
    routes = commonest_routes(arguments.datasets)
    if any(map_key(recording.scenario) not in routes for recording in recordings):
        raise SystemExit("--datasets: expected demonstrations on the map of each recording, found a recording without")
    print("| policy from | routes | success, % | difference | at 480 px | at 720 px |\n|---|---|---:|---:|---:|---:|")
    own: list[Episode] = []
    rows: list[dict[str, Any]] = []
    for handover_x in (0.0, *HANDOVER_X):
        episodes = [episode for run in runs for episode in continued(Checkpoint(run), recordings, handover_x)]
        own = own or episodes
        for kind in ("one", "several"):
            part, own_part = _of_kind(episodes, routes, kind), _of_kind(own, routes, kind)
            if not part:  # few recordings
                continue
            row = {"from_x": handover_x, "routes": kind, "success": success(part)["mean"]}
            row["touched"] = [touched(part, COLUMNS[0], 0.0), touched(part, COLUMNS[1], HANDOVER_X[1])]
            row["difference"] = compare_episodes(part, own_part)["success"] if handover_x else None
            rows.append(row)
            print(_line(row), flush=True)
    result = {"runs": len(runs), "demonstrations": len(recordings), "rows": rows}
    arguments.out.write_text(json.dumps(result, indent=1), encoding="utf-8")


def _of_kind(episodes: Sequence[Episode], routes: Mapping[MapKey, float], kind: str) -> list[Episode]:
    return [e for e in episodes if (routes[map_key(e.scenario)] >= ONE_ROUTE) == (kind == "one")]


def _line(row: Mapping[str, Any]) -> str:
    difference, counts = row["difference"], zip(COLUMNS, row["touched"], strict=True)
    cells = [
        f"{row['from_x']:g} px" if row["from_x"] else "the start",
        row["routes"],
        f"{100 * row['success']:.1f}",
        "" if difference is None else _points(difference),
        *(f"{count} of {of}" if row["from_x"] < column else "" for column, (count, of) in counts),
    ]
    return f"| {' | '.join(cells)} |"


def _points(difference: Mapping[str, Any]) -> str:
    error = difference["standard_error"]  # None on a single map
    return f"{100 * difference['mean']:+.1f}" + ("" if error is None else f" ± {100 * error:.1f}")


if __name__ == "__main__":
    main()
