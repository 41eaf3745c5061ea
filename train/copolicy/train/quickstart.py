"""`copolicy-quickstart`: record, convert, train, evaluate and describe, at a small scale on a CPU.

It runs the commands of the other packages as processes and imports none of their code.
"""

import argparse
import json
import os
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

from copolicy.dataset.command_line.commands import add_common_flags, add_version_flag, run
from copolicy.dataset.command_line.extras import FIGURES, TRAINING
from copolicy.dataset.command_line.flag_numbers import add_whole_number, seed, workers
from copolicy.dataset.files.staging import replace_json

from .quickstart_chain import LOG_FILE, Step, remove_record, run_chain

REPO_ID = "local/quickstart"


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `copolicy-quickstart`."""
    parser = argparse.ArgumentParser(
        prog="copolicy-quickstart",
        description="Record simulated pairs, convert, train a small co-policy, evaluate and describe: on a CPU, in "
        "minutes. The data are of simulated pairs; nothing it prints is a result about people.",
        epilog="example:\n  copolicy-quickstart --out outputs/quickstart",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--out", type=Path, default=Path("outputs/quickstart"), help="folder for all outputs")
    add_whole_number(parser, "--episodes", "simulated episodes (default: 376)", 376)
    add_whole_number(parser, "--steps", "training steps of 512 samples (default: 6000)", 6000)
    add_whole_number(parser, "--limit", "evaluate on the first N maps of each set only")
    parser.add_argument("--seed", type=seed(), default=0, help="default: 0")
    parser.add_argument("--workers", type=workers(), default=os.cpu_count() or 1, help="default: one per core")
    parser.add_argument(
        "--upstream",
        type=Path,
        metavar="PATH",
        help="use files of the original program (raw, processed or zarr) instead of simulated pairs",
    )
    add_version_flag(parser)
    add_common_flags(parser)
    parser.set_defaults(handler=_quickstart, needs=_needs)
    return run(parser, argv)


def _needs(arguments: argparse.Namespace) -> tuple[str, ...]:
    return (*TRAINING, *FIGURES, *(("zarr",) if arguments.upstream else ()))


def _quickstart(arguments: argparse.Namespace) -> dict[str, Any]:
    out: Path = arguments.out
    started = perf_counter()
    run_chain(out, _steps(arguments))
    summary = _summary(arguments, perf_counter() - started)
    replace_json(out / "summary.json", summary, indent=1)
    remove_record(out)
    return summary


def _steps(arguments: argparse.Namespace) -> list[Step]:
    out = arguments.out
    dataset, training = out / "dataset", out / "training"
    if arguments.upstream:
        record = [
            Step(
                "Convert episodes of the original program into a LeRobot v3 data set",
                ("copolicy-convert", "upstream", str(arguments.upstream), "--out", str(dataset), "--repo-id", REPO_ID),
                (dataset,),
            )
        ]
    else:
        recordings = str(out / "recordings")
        record = [
            Step(
                f"Record {arguments.episodes} episodes of simulated pairs, one MCAP file each",
                (
                    *("copolicy-collect", "simulate", "--episodes", str(arguments.episodes)),
                    # With 376 episodes and seed 0 the same as `--recipe pairs-sim-376`.
                    *("--seed", str(arguments.seed), "--maps", "paper36", "--out", recordings),
                    *("--workers", str(arguments.workers)),
                ),
                (out / "recordings",),
            ),
            Step(
                "Convert the recordings into a LeRobot v3 data set at 10 Hz",
                (
                    *("copolicy-convert", "mcap", recordings, "--out", str(dataset), "--repo-id", REPO_ID),
                    *("--license", "cc0-1.0"),
                ),
                (dataset,),
            ),
        ]
    train = Step(
        "Train the co-policy's CPU preset on it",
        (
            *("copolicy-train", "--policy.type=copolicy", "--policy.preset=small", "--policy.device=cpu"),
            *(f"--dataset.repo_id={REPO_ID}", f"--dataset.root={dataset}", f"--output_dir={training}"),
            *(f"--steps={arguments.steps}", "--batch_size=512", f"--seed={arguments.seed}"),
            *(f"--save_freq={arguments.steps}", f"--log_freq={max(1, arguments.steps // 10)}"),
            "--env_eval_freq=0",
        ),
        (training,),
        _mixed_precision(),
    )
    limit = () if arguments.limit is None else ("--limit", str(arguments.limit))
    evaluate = [
        Step(
            f"Evaluate it on the {name} maps, both players from one action chunk",
            (
                *("copolicy-eval", "coplan", "--policy", str(training), "--maps", name),
                *("--out", str(out / "eval" / f"{name}.json"), *limit),
            ),
            (out / "eval" / f"{name}.json", out / "eval" / f"{name}.png"),
        )
        for name in ("holdout", "unseen")
    ]
    describe = Step(
        "Describe the data set",
        # Replaces the minimal card of the conversion, and a card of an interrupted run.
        ("copolicy-cards", "dataset", str(dataset), "--repo-id", REPO_ID, "--overwrite"),
        (),
    )
    return [*record, train, *evaluate, describe]


def _mixed_precision() -> tuple[tuple[str, str], ...]:
    """bfloat16 if the processor has instructions for it: 2.5 times faster than float32 with these, slower without."""
    try:
        flags = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:  # not Linux
        return ()
    return (("ACCELERATE_MIXED_PRECISION", "bf16"),) if "avx512_bf16" in flags or "amx_bf16" in flags else ()


def _summary(arguments: argparse.Namespace, seconds: float) -> dict[str, Any]:
    out: Path = arguments.out
    training = out / "training" / "checkpoints" / "last" / "pretrained_model"
    source = "files of the original program" if arguments.upstream else "simulated pairs"
    rates = {}
    for name in ("holdout", "unseen"):
        success = json.loads((out / "eval" / f"{name}.json").read_text(encoding="utf-8"))["summary"]["success"]
        mean, error = 100 * success["mean"], 100 * success["standard_error"]
        rates[name] = f"{mean:.1f} ± {error:.1f} % success ({success['episodes']} episodes, one training seed)"
    paths = {} if arguments.upstream else {"recordings": str(out / "recordings")}
    paths |= {
        "data set": str(out / "dataset"),
        "card": str(out / "dataset" / "README.md"),
        "checkpoint": str(training),
        "results": f"{out / 'eval' / 'holdout.json'}, {out / 'eval' / 'unseen.json'}",
        "log": str(out / LOG_FILE),
        "figures": f"{out / 'eval' / 'holdout.png'}, {out / 'eval' / 'unseen.png'}",
    }
    # Suggest commands in the form of the user's: through uv, or from an activated environment.
    prefix = "uv run " if "UV_RUN_RECURSION_DEPTH" in os.environ else ""
    return {
        "what was reached": {
            "label": f"trained on {source}, shortly ({arguments.steps} steps of 512 samples); co-planning in "
            "simulation: no person took part",
            **rates,
            "minutes": round(seconds / 60, 1),
        },
        "where it is": paths,
        "what to type next": {
            "a longer training": f"{prefix}copolicy-train --policy.type=copolicy --policy.preset=small "
            f"--policy.device=cpu --dataset.repo_id={REPO_ID} --dataset.root={out / 'dataset'} "
            f"--output_dir={out / 'longer'} --batch_size=512 --steps={3 * arguments.steps}",
            "other maps": f"{prefix}copolicy-eval coplan --policy {training} --maps unseen --orientations "
            f"--out {out / 'eval' / 'orientations.json'}",
            "LeRobot's own evaluation": f"{prefix}lerobot-eval --policy.path={training} --policy.device=cpu "
            f"--env.type=table_carrying --eval.n_episodes=4 --eval.batch_size=2 --output_dir={out / 'lerobot-eval'}",
        },
    }
