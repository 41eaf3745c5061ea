"""What moves the co-policy's success: trains and evaluates one setting after the other, over several seeds.

Demonstrations and partners are simulated pairs: none of these figures is a human result. Each row is a list of flags
beyond the base command; rows whose results are in the folder already are not run again. An hour and more on a CPU:

    uv run python tests/benchmarks/success.py --out outputs/success --rows codp-h codp --seeds 0 1 2

The rows of the paper's size are for a GPU:

    uv run python tests/benchmarks/success.py --out outputs/success --rows paper-size paper --device cuda
"""

import argparse
import json
from pathlib import Path

import numpy as np
from training_study import Row, data_set, evaluate, policy_flags, train

MAPS = ("holdout", "unseen")

_PAPER = {
    "observation_features": "absolute", "prediction_type": "epsilon", "mirror": False, "permute_obstacles": False,
    "sampler": "ddpm", "num_inference_steps": 100,
}  # fmt: skip
_TRANSFORMER = {
    "network": "transformer", "n_layers": 2, "width": 64, "n_heads": 4, "feedforward_width": 256,
}  # fmt: skip
# Learning rate for batches four times the paper's.
_PAPER_SIZE = policy_flags(
    optimizer_lr=4e-4, scheduler_warmup_steps=500, scheduler_final_lr_fraction=0.01, compile_model=True
)
ROWS = {
    "codp-h": Row(),
    "codp": Row(policy_flags(past_human_action=False)),
    "no-symmetry": Row(policy_flags(mirror=False, permute_obstacles=False)),
    "mirror-only": Row(policy_flags(permute_obstacles=False)),
    "permutation-only": Row(policy_flags(mirror=False)),
    "relative": Row(policy_flags(observation_features="relative")),
    "absolute": Row(policy_flags(observation_features="absolute")),
    "epsilon": Row(policy_flags(prediction_type="epsilon")),
    "cold-noise": Row(policy_flags(initial_noise_scale=0.7)),
    "paper-settings": Row(policy_flags(**_PAPER)),
    "paper-settings-long": Row(policy_flags(**_PAPER), steps=60000),
    "absolute-sample-long": Row(policy_flags(**{**_PAPER, "prediction_type": "sample"}), steps=20000),
    "epsilon-long": Row(policy_flags(prediction_type="epsilon"), steps=20000),
    "larger": Row(recipe="pairs-sim-3000", steps=12000),
    "wide-pairs": Row(recipe="pairs-sim-376-wide"),
    "orientations": Row(recipe="pairs-sim-376-orientations", evaluation=("--orientations",)),
    "turned": Row(evaluation=("--orientations",)),
    "transformer": Row(policy_flags(**_TRANSFORMER), steps=12000, batch=256),
    "transformer-codp": Row(policy_flags(**_TRANSFORMER, past_human_action=False), steps=12000, batch=256),
    "transformer-dropout": Row(policy_flags(**_TRANSFORMER, attention_dropout=0.3), steps=12000, batch=256),
    "transformer-long": Row(policy_flags(**_TRANSFORMER), steps=24000, batch=256),
    "long": Row(steps=20000),
    # 1057 divides the frames of the data set, so that no batch is smaller and compiled anew.
    "paper-size": Row(_PAPER_SIZE, preset="default", steps=3527, batch=1057),
    "paper-size-codp": Row((*_PAPER_SIZE, *policy_flags(past_human_action=False)), "default", steps=3527, batch=1057),
    "paper": Row(policy_flags(optimizer_lr=4e-4, compile_model=True), preset="paper", steps=4854, batch=2048),
}


def main() -> None:
    """Runs the rows and prints the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument(
        "--rows", nargs="+", choices=ROWS, default=[name for name, row in ROWS.items() if row.preset == "small"]
    )
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2])
    parser.add_argument("--device", default="cpu", help="where it trains and plans (default: cpu)")
    arguments = parser.parse_args()
    for seed in arguments.seeds:
        for name in arguments.rows:
            run(arguments.out, name, seed, arguments.device)
    print(table(arguments.out))


def run(out: Path, name: str, seed: int, device: str) -> None:
    """Trains and evaluates one row with one seed, as far as it is not done."""
    row, folder = ROWS[name], out / name / f"seed_{seed}"
    training = train(row, data_set(out / "data", row.recipe, row.fps), folder, seed, device)
    for maps in MAPS:
        evaluate(training, maps, folder / f"{maps}.json", row.evaluation, device)
    print(name, seed, *(f"{maps} {_successes(folder / f'{maps}.json').mean():.3f}" for maps in MAPS), flush=True)


def table(out: Path) -> str:
    """Mean and standard error over seeds of each row that has results, in percent."""
    lines = ["| setting | samples | seeds | s of training | holdout % | unseen % |", "|---|---:|---:|---:|---:|---:|"]
    for name, row in ROWS.items():
        folders = [path.parent for path in sorted((out / name).glob("seed_*/unseen.json"))]
        if folders:
            seconds = np.mean([json.loads((folder / "seconds.json").read_text(encoding="utf-8")) for folder in folders])
            cells = [_mean([_successes(folder / f"{maps}.json").mean() for folder in folders]) for maps in MAPS]
            samples = f"{row.steps * row.batch / 1e6:.1f} M"
            lines.append(f"| {name} | {samples} | {len(folders)} | {seconds:.0f} | {cells[0]} | {cells[1]} |")
    return "\n".join(lines)


def _mean(rates: list[float]) -> str:
    values = 100 * np.array(rates)
    if len(values) == 1:
        return f"{values[0]:.1f}"
    return f"{values.mean():.1f} ± {values.std(ddof=1) / len(values) ** 0.5:.1f}"


def _successes(result: Path) -> np.ndarray:
    return np.array([episode["success"] for episode in json.loads(result.read_text(encoding="utf-8"))["episodes"]])


if __name__ == "__main__":
    main()
