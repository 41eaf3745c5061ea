"""Trains and evaluates rows of settings over several seeds; used by success.py and rivals.py.

A folder of a study has the data sets (`data`), and for each row and seed the training with its log and duration. What
is done already is not done again; a training that was interrupted continues from its last checkpoint.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

BATCH = 512
_START = "training_study: from step "
_LOSS = re.compile(r"step:\S+ smpl:.* loss:(\S+)")


@dataclass(frozen=True)
class Row:
    """One setting of a study: a training and how it is evaluated.

    Attributes:
        flags: further flags of the training.
        preset: empty for a policy without presets.
        recipe: simulated pairs of which the data set is made.
        evaluation: further flags of `copolicy-eval coplan`.
        policy: policy type.
        command: command of `copolicy-train` with a trainer of its own; empty for LeRobot's trainer.
        fps: frames a second of the data set.
        bf16: whether it computes in bf16; on a CPU convolutions and LSTMs are slower in it.
    """

    flags: tuple[str, ...] = ()
    preset: str = "small"
    recipe: str = "pairs-sim-376"
    steps: int = 6000
    batch: int = BATCH
    evaluation: tuple[str, ...] = ()
    policy: str = "copolicy"
    command: str = ""
    fps: int = 10
    bf16: bool = True


def policy_flags(**settings: object) -> tuple[str, ...]:
    """Flags of settings of the policy."""
    return tuple(f"--policy.{name}={str(value).lower().replace(' ', '')}" for name, value in settings.items())


def train(row: Row, dataset: Path, folder: Path, seed: int, device: str = "cpu", checkpoints: int = 1) -> Path:
    """Trains a row as far as it is not done, and writes its duration to `seconds.json`.

    Args:
        folder: of this row and seed.
        checkpoints: number of checkpoints, evenly over the steps, of which the last is the result.

    Returns:
        The run.

    Raises:
        SystemExit: the training failed, or an earlier one in this folder had other settings.
    """
    run, finished, seconds = folder / "training", folder / "finished.json", folder / "seconds.json"
    settings = {"row": json.loads(json.dumps(vars(row))), "seed": seed}
    if finished.exists():
        if (earlier := json.loads(finished.read_text(encoding="utf-8"))) != settings:
            sys.exit(f"{finished}: expected {settings}, found {earlier}; give another --out")
        return run
    reached = steps_of(run)
    if reached is not None and reached >= row.steps:
        finished.write_text(json.dumps(settings), encoding="utf-8")
        return run
    if run.exists() and reached is None:
        shutil.rmtree(run)  # interrupted before its first checkpoint
    every = -(-row.steps // checkpoints)  # rounded up: the last checkpoint is that of the last step
    logged = max(1, every // 5)
    numbers = (
        f"--steps={row.steps}", f"--save_freq={every}", f"--log_freq={logged}", "--env_eval_freq=0",
    )  # fmt: skip
    command = (row.command,) if row.command else ()
    if reached:
        flags = [*command, f"--config_path={run}", "--resume=true", *numbers]
    else:
        flags = [
            *command, f"--policy.type={row.policy}", *([f"--policy.preset={row.preset}"] if row.preset else []),
            f"--policy.device={device}", f"--dataset.repo_id=local/{dataset.name}", f"--dataset.root={dataset}",
            f"--output_dir={run}", f"--batch_size={row.batch}", f"--seed={seed}", *numbers, *row.flags,
        ]  # fmt: skip
    log = folder / "training.log"
    folder.mkdir(parents=True, exist_ok=True)
    with log.open("a", encoding="utf-8") as file:
        file.write(f"{_START}{reached or 0}, logged every {logged}\n")
    started, before = perf_counter(), json.loads(seconds.read_text(encoding="utf-8")) if seconds.exists() else 0.0
    try:
        run_command("copolicy-train", *flags, log=log, bf16=row.bf16)
    finally:
        seconds.write_text(json.dumps(before + perf_counter() - started), encoding="utf-8")
    finished.write_text(json.dumps(settings), encoding="utf-8")
    return run


def training_run(folder: Path) -> Path:
    """The run in the folder of a row and seed, or the folder itself if it is a run."""
    run = folder / "training"
    return run if run.exists() else folder


def spread[Item](items: Sequence[Item], limit: int) -> list[Item]:
    """At most `limit` items, spread evenly.

    Raises:
        SystemExit: `limit` is below 1.
    """
    if limit < 1:
        sys.exit(f"--limit: expected at least 1, found {limit}")
    count = min(limit, len(items))
    return [items[index * (len(items) - 1) // max(1, count - 1)] for index in range(count)]


def steps_of(run: Path) -> int | None:
    """Steps of the newest complete checkpoint of a run; None without one."""
    last = run / "checkpoints" / "last"  # the trainer sets this link when the checkpoint is written
    return int(last.resolve().name) if last.exists() else None


def losses(folder: Path, batch: int) -> list[tuple[int, float]]:
    """Samples and training loss of a row and seed, without steps that a resumed training repeated.

    Of a trainer with a log of its own, the discriminator's loss.
    """
    own, log = folder / "training" / "training_log.jsonl", folder / "training.log"
    if own.is_file():
        rows = map(json.loads, own.read_text(encoding="utf-8").splitlines())
        return [(row["step"] * batch, row["discriminator_loss"]) for row in rows if "discriminator_loss" in row]
    found: dict[int, float] = {}
    step = every = 0
    for line in log.read_text(encoding="utf-8", errors="replace").splitlines():
        if line.startswith(_START):
            step, every = map(int, re.findall(r"\d+", line))
            found = {reached: loss for reached, loss in found.items() if reached <= step}
        elif match := _LOSS.search(line):
            step += every - step % every
            found[step] = float(match[1])
    return [(step * batch, loss) for step, loss in sorted(found.items())]


def evaluate(policy: Path, maps: str, result: Path, flags: Sequence[str] = (), device: str = "cpu") -> dict:
    """The result of co-planning on a map set, evaluated unless the file exists."""
    if not result.exists():
        run_command(
            "copolicy-eval", "coplan", "--policy", str(policy), "--maps", maps, "--out", str(result), "--device",
            device, *flags, log=result.with_suffix(".log"),
        )  # fmt: skip
    return json.loads(result.read_text(encoding="utf-8"))


def data_set(folder: Path, recipe: str, fps: int = 10) -> Path:
    """The data set of a recipe at a rate, made in the folder unless it is there."""
    name = recipe if fps == 10 else f"{recipe}-{fps}hz"
    dataset, recordings = folder / name, folder / f"{recipe}-recordings"
    if not dataset.exists():
        log = folder / f"{name}.log"
        if not recordings.exists():
            run_command("copolicy-collect", "simulate", "--recipe", recipe, "--out", str(recordings), log=log)
        run_command(
            "copolicy-convert", "mcap", str(recordings), "--out", str(dataset), "--repo-id", f"local/{name}",
            "--license", "cc0-1.0", "--fps", str(fps), log=log,
        )  # fmt: skip
    return dataset


def run_command(name: str, *flags: str, log: Path, bf16: bool = True) -> None:
    """Runs a command of this package on one thread; its output goes to the log.

    Raises:
        SystemExit: it failed.
    """
    log.parent.mkdir(parents=True, exist_ok=True)
    program = str(Path(sysconfig.get_path("scripts")) / name)
    precision = {"ACCELERATE_MIXED_PRECISION": "bf16" if bf16 else "no"}
    environment = {**precision, "OMP_NUM_THREADS": "1", **os.environ, "HF_HUB_OFFLINE": "1"}
    with log.open("a", encoding="utf-8") as file:
        status = subprocess.run([program, *flags], env=environment, stdout=file, stderr=file).returncode
    if status:
        sys.exit(f"{name} ended with status {status}; see {log}")
