"""Effect of settings of the paper's rivals in execution: co-planning of trained runs with single settings changed.

    uv run python tests/benchmarks/rival_settings.py --runs outputs/rivals/runs/vrnn/seed_* --out vrnn.json

The runs are of one method and differ in their training seed. Each is evaluated on the 84 holdout and the 84 unseen maps
as it is and with each line of `CHANGES`, with the same starts and noise: most changes bring back one published choice
or defect. Differences are in percentage points, with standard errors over maps (bootstrap; the seeds of a map
together). Settings that shape the training are rows of rivals.py. Demonstrations are simulated pairs.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before torch is imported

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from training_study import training_run

from copolicy.dataset.episode import Episode
from copolicy.evaluate.notebook import compare_episodes, coplan_episodes, success
from copolicy.train.checkpoint import Checkpoint

MAPS = ("holdout", "unseen")

_PROPORTIONAL = {"controller": "proportional"}
_UNIT_FORCE = {**_PROPORTIONAL, "unit_force": True}
_ONE = {"n_samples": 1}
_FAR = {"plan_frames": 130, "lookahead_frames": 120}
CHANGES: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    "vrnn": {
        "a history of zeros": {"zero_history": True},
        "absent obstacles are copies of the last": {"repeat_last_obstacle": True},
        "the velocity read as the goal's place": {"velocity_as_goal": True},
        "waypoint 4 s ahead": _FAR,
        "waypoint half a second ahead": {"lookahead_frames": 15},
        "proportional controller": _PROPORTIONAL,
        "proportional controller, forces of unit norm": _UNIT_FORCE,
        "the latter, angles not wrapped": {**_UNIT_FORCE, "wrapped_angle": False},
        "cosines and sines that leave the circle": {"heading_on_circle": False},
        "all published choices but the velocity": {
            **_UNIT_FORCE, **_FAR, "wrapped_angle": False, "zero_history": True, "repeat_last_obstacle": True,
            "heading_on_circle": False,
        },
        "one sampled future, no choice": _ONE,
        "one sampled future, absent obstacles are copies of the last": {**_ONE, "repeat_last_obstacle": True},
        "sampled futures of twice the deviation": {"temperature": 2.0},
    },
    "bc_lstm_gmm": {
        "state never reset": {"sequence_length": 100_000},
        "state reset every frame": {"sequence_length": 1},
        "the likeliest mode": {"execution_mode": "likeliest"},
    },
    "cogail": {
        "code drawn every frame": {"code": "drawn"},
        "code inferred from the partner": {"code": "inferred"},
        "a history of zeros": {"history_start": "zeros"},
    },
}  # fmt: skip
"""For each policy type the changes, by name."""


def episodes(runs: list[Path], maps: str, changes: Mapping[str, Any], limit: int | None) -> list[Episode]:
    """The episodes of all runs with settings changed, one run after the other."""
    return [
        episode for run in runs for episode in coplan_episodes(Checkpoint(run, settings=changes), maps, limit=limit)
    ]


def main() -> None:
    """Evaluates, prints a Markdown table and writes the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", nargs="+", type=Path, required=True, help="training runs of one method")
    parser.add_argument("--out", type=Path, required=True, help="file (JSON) for the results")
    parser.add_argument("--limit", type=int, help="only the first N maps; to try the script")
    arguments = parser.parse_args()
    runs = [training_run(run) for run in arguments.runs]
    types = {Checkpoint(run).policy.config.type for run in runs}
    if len(types) != 1 or not types <= CHANGES.keys():
        raise SystemExit(f"--runs: expected runs of one of {', '.join(CHANGES)}, found {', '.join(sorted(types))}")
    (kind,) = types
    changes = {"as trained": {}, **CHANGES[kind]}
    unchanged = {maps: episodes(runs, maps, {}, arguments.limit) for maps in MAPS}
    result: dict[str, Any] = {"policy": kind, "runs": len(runs), "changes": {}}
    print(f"| {kind}, {len(runs)} runs | holdout % | difference | unseen % | difference |\n|---|---:|---:|---:|---:|")
    for name, changed in changes.items():
        row, cells = {}, [name]
        for maps in MAPS:
            changed_episodes = episodes(runs, maps, changed, arguments.limit) if changed else unchanged[maps]
            difference = compare_episodes(changed_episodes, unchanged[maps])["success"]
            row[maps] = {"success": success(changed_episodes), "difference": difference}
            cells.append(f"{100 * row[maps]['success']['mean']:.1f}")
            cells.append(
                f"{100 * difference['mean']:+.1f} ± {100 * difference['standard_error']:.1f}" if changed else ""
            )
        result["changes"][name] = {"settings": dict(changed), **row}
        print(f"| {' | '.join(cells)} |", flush=True)
    arguments.out.write_text(json.dumps(result, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
