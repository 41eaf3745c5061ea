"""`copolicy-eval partners make`: trains the population `partners-sim` from its recipe."""

import argparse
import os
import shutil
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import Commands, add_command, add_group
from copolicy.dataset.command_line.extras import TRAINING
from copolicy.dataset.command_line.flag_numbers import add_whole_number, workers
from copolicy.dataset.exceptions import OutputExistsError, UnknownNameError
from copolicy.dataset.files.staging import replace_json
from copolicy.train.quickstart_chain import Step, run_chain

from .population import CHOOSING, DOCUMENT, NAME, PROXIES, REPORTING, ProxyRecipe, described, half_of

_EXAMPLE = "copolicy-eval partners make --out outputs/partners"


def add_partners_command(commands: Commands) -> None:
    """Adds `partners make` to the commands of `copolicy-eval`."""
    group = add_group(
        commands,
        "partners",
        "make the population of learned partners",
        "Partners of robots that are themselves learned, from simulated pairs that no published data set has.",
        [_EXAMPLE],
    )
    command = add_command(
        group,
        "make",
        _make,
        f"simulate, convert, train and export the proxies of {NAME}; a second call continues",
        _EXAMPLE,
        TRAINING,
    )
    command.add_argument("--out", required=True, type=Path, help="folder of the population: one policy per proxy")
    command.add_argument("--only", nargs="+", metavar="NAME", help="make these only (default: all), or a half's name")
    command.add_argument("--device", default="cpu", help="torch device of the trainings (default: cpu)")
    command.add_argument("--workers", type=workers(), default=os.cpu_count() or 1, help="processes of the simulation")
    add_whole_number(command, "--limit-steps", "train at most so many steps, for a trial; the record says so")
    add_whole_number(command, "--limit-episodes", "record at most so many episodes, for a trial; the record says so")


def _make(arguments: argparse.Namespace) -> dict[str, Any]:
    out: Path = arguments.out
    if out.exists() and not out.is_dir():
        raise OutputExistsError(out)
    names = _chosen(arguments.only)
    for name in names:
        policy, work = out / name, out / "work" / name
        if policy.is_dir():
            continue
        run_chain(work, _steps(PROXIES[name], work, policy, arguments))
        shutil.rmtree(work)
    if (out / "work").is_dir() and not any((out / "work").iterdir()):
        (out / "work").rmdir()
    limits = {
        name: value
        for name, value in (("limit_steps", arguments.limit_steps), ("limit_episodes", arguments.limit_episodes))
        if value
    }
    replace_json(out / DOCUMENT, {**described(), **({"trial": limits} if limits else {})})
    return {
        "population": NAME,
        "proxies": names,
        "out": str(out),
        "partners": [f"population:{out}#{half}" for half in (CHOOSING, REPORTING)],
        **({"trial": limits} if limits else {}),
    }


def _chosen(only: list[str] | None) -> list[str]:
    names: list[str] = []
    for name in only or list(PROXIES):
        if name not in (CHOOSING, REPORTING, *PROXIES):
            raise UnknownNameError("proxy", name, PROXIES)
        names += half_of(name)[0] if name in (CHOOSING, REPORTING) else [name]
    return list(dict.fromkeys(names))


def _steps(recipe: ProxyRecipe, work: Path, policy: Path, arguments: argparse.Namespace) -> list[Step]:
    recordings, data, run = work / "recordings", work / "dataset", work / "training"
    repo_id = f"local/{NAME}-{recipe.pair}"
    episodes = min(recipe.episodes, arguments.limit_episodes or recipe.episodes)
    steps = min(recipe.steps, arguments.limit_steps or recipe.steps)
    record = (
        *("copolicy-collect", "simulate", "--pairs", recipe.pair, "--episodes", str(episodes)),
        *("--seed", str(recipe.seed), "--maps", recipe.maps, "--orientations", "--start-noise", "1"),
        *("--workers", str(arguments.workers), "--out", str(recordings)),
    )
    convert = (
        *("copolicy-convert", "mcap", str(recordings), "--out", str(data), "--repo-id", repo_id),
        *("--license", "cc0-1.0"),
    )
    train = (
        *("copolicy-train", "--policy.type=copolicy", "--policy.preset=small", f"--policy.device={arguments.device}"),
        *(f"--policy.width={recipe.width}", f"--policy.n_layers={recipe.n_layers}"),
        *(f"--dataset.repo_id={repo_id}", f"--dataset.root={data}", f"--output_dir={run}", f"--steps={steps}"),
        *(f"--batch_size={recipe.batch_size}", f"--seed={recipe.seed}", f"--save_freq={steps}", "--env_eval_freq=0"),
    )
    export = ("copolicy-train", "export", str(run), "--out", str(policy))
    return [
        Step(f"Record {episodes} episodes of the simulated pair {recipe.pair}", record, (recordings,)),
        Step("Convert them", convert, (data,)),
        Step(f"Train {policy.name}, {steps} steps", train, (run,)),
        Step(f"Export {policy}", export, (policy,)),
    ]
