"""The paper's rivals beside the co-policy: trains every method over several seeds, and makes the co-planning table.

Demonstrations are simulated pairs: none of these figures is a human result. Rows are settings of a method; what is in
the folder already is not done again, and an interrupted training continues. Days of one CPU core for all rows:

    uv run python tests/benchmarks/rivals.py --out outputs/rivals --workers 2
    uv run python tests/benchmarks/rivals.py --out outputs/rivals --rows codp-h bc-scan --seeds 0 1 2
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
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from training_study import Row, data_set, evaluate, losses, policy_flags, run_command, train

CURVE_MAPS = "training"
_RIVALS_HZ = 30  # frames a second of the paper's rivals


@dataclass(frozen=True)
class Point:
    """A checkpoint along a training: samples drawn, and success on the maps of the demonstrations."""

    samples: int
    success: float


_ORDERS = "pairs-sim-376-orders"
"""Data of rows that read the obstacles as a list; the scan sees no order. See train/docs/comparison.md."""
_ORIENTATIONS = "pairs-sim-376-orientations"
"""Data with the four start orientations of a cross-play; all others have one."""
_PAPER_INPUTS = {"observation_features": "absolute", "mirror": False, "permute_obstacles": False}
_PAPER_SETTINGS = {
    **_PAPER_INPUTS, "prediction_type": "epsilon", "sampler": "ddpm", "num_inference_steps": 100,
}  # fmt: skip
# Networks of LeRobot's policies that one core trains; ACT's chunks are about as long as the paper's.
DIFFUSION_NETWORK: Mapping[str, Any] = {"down_dims": [32, 64, 128], "diffusion_step_embed_dim": 64}
ACT_NETWORK: Mapping[str, Any] = {
    "chunk_size": 16, "n_action_steps": 8, "dim_model": 128, "n_heads": 4, "dim_feedforward": 512,
}  # fmt: skip
_DIFFUSION = policy_flags(**DIFFUSION_NETWORK)
_ACT = policy_flags(**ACT_NETWORK, optimizer_lr=1e-4)
# LeRobot scales no column of the kind ENV unless it is told to: goal and obstacles reach the network in px.
_SCALED = '--policy.normalization_mapping={"STATE":"MIN_MAX","ENV":"MIN_MAX","ACTION":"MIN_MAX"}'

# With scaled inputs ten times the constant rate, with a decay, reaches in 0.6 M windows what that does in 1.5 M.
_BC_RATE = policy_flags(optimizer_lr=1e-3, scheduler_final_lr_fraction=0)
_NO_VELOCITY = policy_flags(masked_state=["vx", "vy", "omega"])


def _recipe(preset: str) -> str:
    return "pairs-sim-376" if preset in ("scan", "small", "cnn-small") else _ORDERS


def _codp(recipe: str = "pairs-sim-376", steps: int = 6_000, **changed: object) -> Row:
    """The MLP of the preset `small`, in float32 as the other methods."""
    return Row(policy_flags(**changed), recipe=recipe, steps=steps, bf16=False)


def _bc(preset: str, fps: int, recipe: str | None = None, steps: int = 6_000, flags: tuple[str, ...] = _BC_RATE) -> Row:
    """robomimic's batch; `_BC_RATE` on a short budget."""
    settings = {"policy": "bc_lstm_gmm", "fps": fps, "steps": steps, "batch": 100}
    return Row(flags, preset, recipe or _recipe(preset), bf16=False, **settings)


def _vrnn(preset: str, steps: int = 10_000, flags: tuple[str, ...] = (), **changed: object) -> Row:
    settings = {"policy": "vrnn", "fps": _RIVALS_HZ}
    return Row((*flags, *policy_flags(**changed)), preset, _recipe(preset), steps, 64, bf16=False, **settings)


def _cogail(preset: str, steps: int = 6_000_000, **changed: object) -> Row:
    """Its own command: a step is a frame in the world."""
    settings = {"policy": "cogail", "command": "cogail", "fps": _RIVALS_HZ}
    return Row(policy_flags(**changed), preset, _recipe(preset), steps, 1, bf16=False, **settings)


_FIRST_FILES = f"--dataset.episodes={list(range(30))}".replace(" ", "")  # all that the published loader read
# Single published choices of the training, each in the corrected settings; those of execution: rival_settings.py.
_VRNN_CHOICES: Mapping[str, Mapping[str, Any]] = {
    "loss": {"loss_balance": "published"},
    "predicted-row": {"predicted": "row"},
    "prior": {"encoded_frames": 30},
    "scene-axes": {"motion_axes": "scene"},
    "px": {"scaled_rows": False, "loss_balance": "published"},  # the other balance is of scaled rows
    "no-pose": {"observe_pose": False},
    "cycles": {"kl_cycles": 4, "kl_ramp": 0.5},
    "weight-decay": {"optimizer_weight_decay": 0.2},
    "windows": {"window_frames": 120, "stride": 1, "encoded_frames": 120},  # 4 s, encoded as long
    "no-clipping": {"optimizer_grad_clip_norm": 0.0},
}
_COGAIL_CHOICES: Mapping[str, Mapping[str, Any]] = {
    "unit-range": {"input_range": "unit"},
    "zeros": {"history_start": "zeros"},
    "unbounded": {"bounded_actions": False},
    "first-frame": {"start_frames": "first"},
    "exploration": {"initial_deviation": 1.0},
    "logit": {"reward": "logit"},
    "zero-success": {"after_success": "zero"},
}


def _cnn(preset: str, steps: int = 5_000, recipe: str | None = None, flags: tuple[str, ...] = ()) -> Row:
    return Row(flags, preset, recipe or _recipe(preset), steps, 256, bf16=False)


def _lerobot(policy: str, steps: int, *flags: str) -> Row:
    return Row(flags, "", _ORDERS, steps, 64, policy=policy, bf16=False)


ROWS: Mapping[str, Row] = {
    "codp-h": _codp(),
    "codp-h-long": _codp(steps=12_000),
    "codp-h-orientations": _codp(_ORIENTATIONS),
    "codp": _codp(past_human_action=False),
    "codp-h-paper": _codp(_ORDERS, **_PAPER_INPUTS),
    "codp-h-paper-long": _codp(_ORDERS, 18_000, **_PAPER_INPUTS),
    "codp-h-paper-longer": _codp(_ORDERS, 36_000, **_PAPER_INPUTS),
    "codp-paper": _codp(_ORDERS, past_human_action=False, **_PAPER_INPUTS),
    "codp-paper-long": _codp(_ORDERS, 18_000, past_human_action=False, **_PAPER_INPUTS),
    "codp-h-paper-settings": _codp(_ORDERS, 20_000, **_PAPER_SETTINGS),
    "codp-h-paper-settings-long": _codp(_ORDERS, 40_000, **_PAPER_SETTINGS),
    "bc-paper": _bc("paper", _RIVALS_HZ),
    "bc-paper-10hz": _bc("paper", 10),
    "bc-paper-rate": _bc("paper", _RIVALS_HZ, steps=15_000, flags=()),  # rows "rate": the published constant one
    "bc-paper-10hz-rate": _bc("paper", 10, steps=15_000, flags=()),
    "bc-paper-10hz-rate-long": _bc("paper", 10, steps=30_000, flags=()),
    "bc-normalized": _bc("normalized", _RIVALS_HZ),
    "bc-normalized-10hz": _bc("normalized", 10),
    "bc-normalized-10hz-long": _bc("normalized", 10, steps=15_000),
    "bc-normalized-10hz-rate": _bc("normalized", 10, steps=15_000, flags=()),
    "bc-paper-10hz-rate-no-velocity": _bc("paper", 10, steps=15_000, flags=_NO_VELOCITY),
    "bc-normalized-10hz-no-velocity": _bc("normalized", 10, flags=(*_BC_RATE, *_NO_VELOCITY)),
    "bc-scan-10hz-no-velocity": _bc("scan", 10, flags=(*_BC_RATE, *_NO_VELOCITY)),
    "bc-scan": _bc("scan", _RIVALS_HZ),
    "bc-scan-10hz": _bc("scan", 10),
    "bc-scan-10hz-long": _bc("scan", 10, steps=15_000),
    "bc-scan-10hz-rate": _bc("scan", 10, steps=15_000, flags=()),
    "bc-scan-10hz-orientations": _bc("scan", 10, _ORIENTATIONS),
    "cnn": _cnn("cnn"),
    "cnn-inpainting": _cnn("cnn-inpainting"),
    "cnn-small": _cnn("cnn-small", 800),
    "cnn-small-long": _cnn("cnn-small", 3_200),
    "cnn-small-longer": _cnn("cnn-small", 6_400),
    "cnn-small-paper": _cnn("cnn-small", 3_200, _ORDERS, policy_flags(**_PAPER_INPUTS)),
    "vrnn-paper": _vrnn("paper"),
    "vrnn": _vrnn("default"),
    "vrnn-long": _vrnn("default", 25_000),
    "vrnn-longer": _vrnn("default", 60_000),
    "vrnn-30-files": _vrnn("default", flags=(_FIRST_FILES,)),
    "vrnn-scan": _vrnn("scan"),
    "vrnn-scan-long": _vrnn("scan", 25_000),
    "vrnn-scan-longer": _vrnn("scan", 60_000),
    "cogail": _cogail("paper"),
    "cogail-corrected": _cogail("corrected"),
    "cogail-corrected-long": _cogail("corrected", 12_000_000),
    "cogail-scan": _cogail("scan"),
    "cogail-scan-long": _cogail("scan", 12_000_000),
    **{f"vrnn-{name}": _vrnn("default", **changed) for name, changed in _VRNN_CHOICES.items()},
    **{f"cogail-{name}": _cogail("corrected", **changed) for name, changed in _COGAIL_CHOICES.items()},
    "diffusion": _lerobot("diffusion", 6_400, *_DIFFUSION),
    "diffusion-scaled": _lerobot("diffusion", 6_400, *_DIFFUSION, _SCALED),
    "act": _lerobot("act", 1_600, *_ACT),
    "act-scaled": _lerobot("act", 1_600, *_ACT, _SCALED.replace("MIN_MAX", "MEAN_STD")),
}
"""The methods, each with its budget on a CPU."""


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
