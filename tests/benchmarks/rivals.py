"""The paper's rivals beside the co-policy: trains every method over several seeds, and makes the co-planning table.

Demonstrations are simulated pairs: none of these figures is a human result. Rows are settings of a method; what is in
the folder already is not done again, and an interrupted training continues. Days of one CPU core for all rows:

    uv run python tests/benchmarks/rivals.py --out outputs/rivals --workers 2
    uv run python tests/benchmarks/rivals.py --out outputs/rivals --rows codp-h bc-scan-10hz --seeds 0 1 2
    uv run python tests/benchmarks/rivals.py --list

Checkpoints along each training are evaluated on the maps of the demonstrations (`training`), never on those of the
table: `curves.png` shows success and training loss against samples, from which one sees whether a budget reaches the
plateau. The table is in `table/`. `--scale 0.1` trains a tenth of every budget.
"""

import argparse
import json
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from rival_rows import ROWS
from training_study import Row, data_set, evaluate, losses, run_command, train

CURVE_MAPS = "training"


@dataclass(frozen=True)
class Point:
    """A checkpoint along a training: samples drawn, and success on the maps of the demonstrations."""

    samples: int
    success: float


def main() -> None:
    """Trains, evaluates the checkpoints, makes the table and the figure of the curves."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, help="folder of the study")
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=list(ROWS), help="default: all")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2])
    parser.add_argument("--workers", type=int, default=1, help="trainings at the same time, one thread each")
    parser.add_argument("--checkpoints", type=int, default=6, help="points of a curve (default: 6)")
    parser.add_argument("--scale", type=float, default=1.0, help="factor of every budget")
    parser.add_argument("--data", type=Path, help="folder for data sets and recordings (default: OUT/data)")
    parser.add_argument("--limit", type=int, help="only the first N maps, also in the table; to try the script")
    parser.add_argument("--list", action="store_true", help="print the rows and their budgets")
    arguments = parser.parse_args()
    if arguments.list or arguments.out is None:
        print(budgets(ROWS))
        return
    study = Study(arguments)
    jobs = [(name, seed) for seed in arguments.seeds for name in arguments.rows]
    with ThreadPoolExecutor(arguments.workers) as workers:
        for line in workers.map(lambda job: study.train_and_follow(*job), jobs):
            print(line, flush=True)
    save_curves(study.curves(arguments.rows, arguments.seeds), arguments.out / "curves.png")
    study.make_table(arguments.rows)
    print((arguments.out / "table" / "table.md").read_text(encoding="utf-8"))


def budgets(rows: Mapping[str, Row]) -> str:
    """The rows as a Markdown table."""
    lines = ["| row | policy, preset | data | Hz | steps | batch | flags |", "|---|---|---|---:|---:|---:|---|"]
    for name, row in rows.items():
        policy = ", ".join(filter(None, (row.policy, row.preset)))
        lines.append(
            f"| {name} | {policy} | {row.recipe} | {row.fps} | {row.steps:,} | {row.batch} | `{' '.join(row.flags)}` |"
        )
    return "\n".join(lines)


class Study:
    """The folder of a study: `data`, `runs/ROW/seed_S`, `curves/ROW/seed_S`, `table`."""

    def __init__(self, arguments: argparse.Namespace):
        self.out: Path = arguments.out
        self._checkpoints, self._scale = arguments.checkpoints, arguments.scale
        self._limit = () if arguments.limit is None else ("--limit", str(arguments.limit))
        # Made before the workers begin, which would make them twice.
        self._data = {
            (row.recipe, row.fps): data_set(arguments.data or self.out / "data", row.recipe, row.fps)
            for row in (ROWS[name] for name in arguments.rows)
        }

    def row(self, name: str) -> Row:
        """A row with its budget scaled."""
        return replace(ROWS[name], steps=max(1, round(ROWS[name].steps * self._scale)))

    def train_and_follow(self, name: str, seed: int) -> str:
        """Trains a row with one seed and evaluates its checkpoints on the maps of the demonstrations."""
        row, folder = self.row(name), self.out / "runs" / name / f"seed_{seed}"
        run = train(row, self._data[row.recipe, row.fps], folder, seed, checkpoints=self._checkpoints)
        for checkpoint in sorted(run.glob("checkpoints/[0-9]*")):
            result = self._curve_folder(name, seed) / f"{checkpoint.name}.json"
            evaluate(checkpoint / "pretrained_model", CURVE_MAPS, result, (*row.evaluation, *self._limit))
        points = self.curve(name, seed)
        return f"{name} {seed}: " + ", ".join(f"{p.samples:,}: {100 * p.success:.1f} %" for p in points)

    def curve(self, name: str, seed: int) -> list[Point]:
        """Success along a training."""
        points = []
        for path in sorted(self._curve_folder(name, seed).glob("[0-9]*.json")):
            result = json.loads(path.read_text(encoding="utf-8"))
            points.append(Point(int(path.stem) * self.row(name).batch, result["summary"]["success"]["mean"]))
        return points

    def curves(
        self, names: list[str], seeds: list[int]
    ) -> dict[str, list[tuple[list[Point], list[tuple[int, float]]]]]:
        """Success and loss along the trainings of each row, one entry per seed."""
        return {
            name: [
                (
                    self.curve(name, seed),
                    losses(self.out / "runs" / name / f"seed_{seed}", self.row(name).batch),
                )
                for seed in seeds
            ]
            for name in names
        }

    def make_table(self, names: list[str]) -> None:
        """Calls `copolicy-eval table coplanning`, which evaluates on the maps of the table what is not evaluated."""
        runs = [f"{name}={self.out / 'runs' / name}" for name in names]
        flags = ("table", "coplanning", "--runs", *runs, "--out", str(self.out / "table"), *self._limit)
        run_command("copolicy-eval", *flags, log=self.out / "table.log")

    def _curve_folder(self, name: str, seed: int) -> Path:
        return self.out / "curves" / name / f"seed_{seed}"


def save_curves(curves: Mapping[str, list[tuple[list[Point], list[tuple[int, float]]]]], path: Path) -> None:
    """Draws success (with its mean over seeds) and training loss against samples, one column per row of the study."""
    columns = min(6, len(curves))
    lines = -(-len(curves) // columns)
    figure = Figure(figsize=(2.9 * columns, 3.6 * lines), dpi=110, layout="constrained")
    axes = figure.subplots(2 * lines, columns, squeeze=False)
    for axis in axes.flat:
        axis.set_visible(False)
    title, of_mean = "Simulated pairs: success on the maps of the demonstrations and training loss, a line a seed", ""
    for index, (name, seeds) in enumerate(curves.items()):
        line, column = divmod(index, columns)
        success, loss = axes[2 * line, column], axes[2 * line + 1, column]
        success.set_visible(True)
        success.set(title=name, ylim=(0, 100), ylabel=f"success on {CURVE_MAPS}, %" if column == 0 else "")
        for points, values in seeds:
            success.plot([p.samples / 1e6 for p in points], [100 * p.success for p in points], "o-", alpha=0.5, ms=3)
            if values:
                loss.set_visible(True)
                loss.plot([samples / 1e6 for samples, _ in values], [value for _, value in values], alpha=0.7)
        if len({len(points) for points, _ in seeds}) == 1 and seeds[0][0] and len(seeds) > 1:
            of_mean = "; black: mean over seeds"
            means = np.mean([[p.success for p in points] for points, _ in seeds], axis=0)
            success.plot([p.samples / 1e6 for p in seeds[0][0]], 100 * means, "k-", linewidth=2)
        loss.set(xlabel="samples, M", ylabel="training loss" if column == 0 else "")
        for axis in (success, loss):
            axis.grid(alpha=0.3)
    figure.suptitle(title + of_mean)
    figure.savefig(path)


if __name__ == "__main__":
    main()
