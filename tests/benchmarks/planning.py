"""Time of one plan, and of the 84-map study, beside a plain implementation of the paper's sampler; on one thread.

    uv run python tests/benchmarks/planning.py            one plan at a time, as beside a person
    uv run python tests/benchmarks/planning.py --study    84 tables at once, as `copolicy-eval coplan`
    uv run python tests/benchmarks/planning.py --batches  1 to 84 tables at once, as `auto` decides by

The plain implementation is the paper's network (8 layers of width 256) as torch modules, all twelve tokens, memory
and mask anew at each step, with diffusers' DDPM scheduler. Weights are random: time is what is measured. Rounds are
interleaved, so that other load falls on all alike; each plan is timed after one by the same policy, as in a loop that
plans at every tick, and not after those of others, which leave nothing of its weights in the cache. Ratios are those
of the medians within this run.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"  # before torch is imported

import argparse
import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import torch
from lerobot.configs import FeatureType, PolicyFeature

from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.tasks.table.features import FEATURES, environment_state
from copolicy.tasks.table.maps import MAP_SETS
from lerobot_policy_copolicy import CopolicyConfig
from lerobot_policy_copolicy.copolicy.modeling_copolicy import CopolicyPolicy

PLAIN, DDPM, FEW = {"planner": "plain"}, {"sampler": "ddpm"}, {"sampler": "ddim"}
TICK_MS = 1e3 / 30


def policy(preset: str, steps: int, **settings: Any) -> CopolicyPolicy:
    """A policy with random weights and the preset's network."""
    kinds = {ENVIRONMENT_STATE: FeatureType.ENV}
    config = CopolicyConfig(
        preset=preset,
        device="cpu",
        input_features={
            key: PolicyFeature(kinds.get(key, FeatureType.STATE), FEATURES[key]["shape"])
            for key in (STATE, ENVIRONMENT_STATE, HUMAN_ACTION)
        },
        output_features={ACTION: PolicyFeature(FeatureType.ACTION, (4,))},
        num_inference_steps=steps,
        ema=False,
        **settings,
    )
    torch.manual_seed(0)
    return CopolicyPolicy(config).eval()


def histories(tables: int) -> dict[str, torch.Tensor]:
    """What the tables of the holdout maps show at their starts."""
    rows: dict[str, list] = {STATE: [], ENVIRONMENT_STATE: [], HUMAN_ACTION: []}
    for config in MAP_SETS["holdout"][:tables]:
        x, y, theta = config.start
        rows[STATE].append([x, y, np.cos(theta), np.sin(theta), 0, 0, 0])
        rows[ENVIRONMENT_STATE].append(environment_state(config))
        rows[HUMAN_ACTION].append([0, 0])
    return {key: torch.tensor(np.array(values)).float()[:, None].repeat(1, 3, 1) for key, values in rows.items()}


def measure(plans: dict[str, Callable[[], object]], rounds: int, clock: Callable[[], float]) -> dict[str, list[float]]:
    """Milliseconds of each plan in each round."""
    took: dict[str, list[float]] = {name: [] for name in plans}
    for _ in range(rounds):
        for name, make in plans.items():
            make()
            begin = clock()
            make()
            took[name].append(1e3 * (clock() - begin))
    return took


def planned(name: str, batch: dict[str, torch.Tensor], actions: int | None, made: CopolicyPolicy) -> Callable:
    """A call that samples once, after printing once how long the first one took."""
    begin = time.perf_counter()
    made.sample_actions(batch, actions=actions)
    if made.config.planner != "plain":
        print(f"first plan, with its tables: {1e3 * (time.perf_counter() - begin):7.1f} ms  {name}")
    return lambda: made.sample_actions(batch, actions=actions)


def one_plan(rounds: int, clock: Callable[[], float]) -> None:
    """A plan of one table, one action or eight executed."""
    batch = histories(1)
    choices: dict[str, tuple[CopolicyPolicy, int | None]] = {
        "plain, DDPM 100 steps": (policy("paper", 100, **PLAIN), None),
        "plain, DDPM 34 steps": (policy("paper", 34, **PLAIN), None),
    }
    for backend in ("torch", "onnx", "numba", "auto"):
        for label, preset, steps, sampler, actions in (
            ("DDPM 100 steps, 8 actions", "paper", 100, DDPM, 8),
            ("DDPM 34 steps, 1 action", "paper", 34, DDPM, 1),
            ("DDIM 10 steps, 8 actions", "paper", 10, FEW, 8),
            ("DDIM 10 steps, 1 action", "paper", 10, FEW, 1),
            ("DDIM 5 steps, 1 action", "paper", 5, FEW, 1),
            ("small MLP, DDPM 34 steps", "small", 34, DDPM, 1),
            ("small MLP, DDIM 10 steps", "small", 10, FEW, 1),
        ):
            choices[f"{backend}, {label}"] = policy(preset, steps, **sampler, backend=backend), actions
    plans = {name: planned(name, batch, actions, made) for name, (made, actions) in choices.items()}
    took = measure(plans, rounds, clock)
    medians = {name: statistics.median(values) for name, values in took.items()}
    print(f"\n{'one plan, ms':<34} {'p50':>8} {'p95':>8} {'to plain 100':>13} {'to plain 34':>12}   within 33 ms")
    for name, values in took.items():
        late = float(np.quantile(values, 0.95))
        ratios = [medians[f"plain, DDPM {steps} steps"] / medians[name] for steps in (100, 34)]
        print(
            f"{name:<34} {medians[name]:>8.1f} {late:>8.1f} {ratios[0]:>12.1f}x {ratios[1]:>11.1f}x   "
            f"{'yes' if late < TICK_MS else 'no'}"
        )
    exact, few = (
        medians["plain, DDPM 34 steps"] / medians[f"numba, {steps}, 1 action"]
        for steps in ("DDPM 34 steps", "DDIM 10 steps")
    )
    print(f"\naims: exact 34-step plan 12x, here {exact:.1f}x; 10-step plan 35x, here {few:.1f}x ", end="")
    print("(one action, numba; both to the plain 34 steps)")


def study(rounds: int, tables: int, share: int, clock: Callable[[], float]) -> None:
    """Plans of all tables at once.

    Every step of a chain costs the same, so the plain sampler and the exact ones are timed on a fraction of their
    steps, all on the same one.
    """
    batch = histories(tables)
    shorter = 100 // share
    choices: dict[str, tuple[CopolicyPolicy, int | None, int]] = {
        "plain, DDPM 100 steps": (policy("paper", shorter, **PLAIN), None, share),
    }
    for backend in ("torch", "onnx"):
        choices[f"{backend}, DDPM 100 steps"] = policy("paper", shorter, **DDPM, backend=backend), 8, share
        for steps in (10, 8, 5):
            choices[f"{backend}, DDIM {steps} steps"] = policy("paper", steps, **FEW, backend=backend), 8, 1
    plans = {name: planned(name, batch, actions, made) for name, (made, actions, _) in choices.items()}
    took = measure(plans, rounds, clock)
    medians = {name: statistics.median(values) * choices[name][2] for name, values in took.items()}
    plain = medians["plain, DDPM 100 steps"]
    print(f"\n{f'one plan for each of {tables} tables, ms':<34} {'p50':>9} {'to plain':>9} {'42 plans':>10}")
    for name, milliseconds in medians.items():
        print(f"{name:<34} {milliseconds:>9.0f} {plain / milliseconds:>8.1f}x {42e-3 * milliseconds:>8.0f} s")
    exact, *few = (plain / medians[f"onnx, {name} steps"] for name in ("DDPM 100", "DDIM 10", "DDIM 8", "DDIM 5"))
    print(f"\naims: exact 2.3x, here {exact:.1f}x; with few steps 25x, here ", end="")
    print(", ".join(f"{ratio:.1f}x with {steps}" for ratio, steps in zip(few, (10, 8, 5), strict=True)))


def batches(rounds: int, clock: Callable[[], float]) -> None:
    """Plans of 1 to 84 tables at once with each backend, five DDIM steps, and which one `auto` takes."""
    print(f"{'one plan for each table, ms':<34} {'torch':>8} {'onnx':>8} {'numba':>8}   auto")
    for preset in ("small", "paper"):
        for actions in (1, 8):
            for tables in (1, 2, 4, 8, 16, 32, 84):
                batch = histories(tables)
                made = {name: policy(preset, 5, **FEW, backend=name) for name in ("torch", "onnx", "numba", "auto")}
                made["auto"].sample_actions(batch, actions=actions)
                (chosen,) = made.pop("auto").planned_with
                plans: dict[str, Callable[[], object]] = {
                    name: partial(planner.sample_actions, batch, actions=actions) for name, planner in made.items()
                }
                took = measure(plans, rounds, clock)
                medians = " ".join(f"{statistics.median(values):>8.1f}" for values in took.values())
                print(f"{f'{preset}, {actions} actions, {tables} tables':<34} {medians}   {chosen}")


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--study", action="store_true", help="84 tables at once")
    parser.add_argument("--batches", action="store_true", help="1 to 84 tables at once")
    parser.add_argument("--rounds", type=int, help="interleaved rounds (default: 31, with --study 5)")
    parser.add_argument("--tables", type=int, default=84, help="of the study (default: 84)")
    parser.add_argument(
        "--share", type=int, default=10, help="with --study: 100-step chains are timed on 100 / N of them (default: 10)"
    )
    parser.add_argument(
        "--cpu-time", action="store_true", help="the thread's own time, where others use the machine; no latency then"
    )
    arguments = parser.parse_args()
    clock = time.thread_time if arguments.cpu_time else time.perf_counter
    torch.set_num_threads(1)
    with torch.inference_mode():
        if arguments.batches:
            batches(arguments.rounds or 5, clock)
        elif arguments.study:
            study(arguments.rounds or 5, arguments.tables, arguments.share, clock)
        else:
            one_plan(arguments.rounds or 31, clock)


if __name__ == "__main__":
    main()
