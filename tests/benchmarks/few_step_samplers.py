"""Whether a checkpoint may plan with fewer steps: success and route diversity of each sampler against DDPM-100.

    uv run python tests/benchmarks/few_step_samplers.py outputs/run --repeats 8 --out few_steps.json

Co-planning on the 84 holdout and the 84 unseen maps, every map `--repeats` times, the same starts and the same seed
of the noise for every sampler. A sampler is accepted where

- success is at most 2 points below that of DDPM-100 (mean over maps of the difference within the map, with its
  standard error over maps), and
- the entropy of the routes within a map differs by at most 0.1 bit (over maps with obstacles where both samplers
  reached the goal twice or more; Miller-Madow's correction for few repeats). Shares pooled over maps would hide a
  sampler that always takes the same route on the same map.

All of it is simulated: no person takes part. One CPU core plans some 84 tables times 100 steps of the small network
in a second; `--backend onnx` is two to three times as fast with the paper's.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before torch is imported

import argparse
import json
import math
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from copolicy.dataset.command_line.commands import progress_bar
from copolicy.evaluate.coplan.rollouts import EpisodeResult, coplan
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.routes import route_class
from copolicy.train.checkpoint import Checkpoint

REFERENCE = ("ddpm", 100)
SAMPLERS = [(name, steps) for name in ("ddim", "dpmsolver++") for steps in (10, 8, 5)]
SUCCESS_MARGIN, ENTROPY_MARGIN = 0.02, 0.1


def route_entropy(outcomes: Sequence[EpisodeResult]) -> float | None:
    """Entropy in bits of the routes that reached the goal on one map; None with fewer than two."""
    routes = Counter(route_class(one.path, one.scenario) for one in outcomes if one.success and one.path is not None)
    total = sum(routes.values())
    if total < 2:
        return None
    shares = [count / total for count in routes.values()]
    return -sum(share * math.log2(share) for share in shares) + (len(routes) - 1) / (2 * total * math.log(2))


def success_share(outcomes: Sequence[EpisodeResult]) -> float:
    """Share of the episodes that reached the goal."""
    return sum(outcome.success for outcome in outcomes) / len(outcomes)


def by_map(outcomes: Sequence[EpisodeResult]) -> list[list[EpisodeResult]]:
    """The repeats of each map, in the order of the maps."""
    groups: dict[int, list[EpisodeResult]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome.map_index, []).append(outcome)
    return [groups[index] for index in sorted(groups)]


def paired(differences: Sequence[float]) -> dict[str, float | int | None]:
    """Mean of differences within maps, with its standard error over maps."""
    values = np.array(differences)
    if len(values) < 2:
        return {"mean": None, "standard_error": None, "maps": len(values)}
    return {
        "mean": float(values.mean()),
        "standard_error": float(values.std(ddof=1) / math.sqrt(len(values))),
        "maps": len(values),
    }


def compare(outcomes: Sequence[EpisodeResult], reference: Sequence[EpisodeResult]) -> dict:
    """One sampler against the reference, map by map."""
    pairs = list(zip(by_map(outcomes), by_map(reference), strict=True))
    success = paired([success_share(ours) - success_share(theirs) for ours, theirs in pairs])
    entropies = [(route_entropy(a), route_entropy(b)) for a, b in pairs if a[0].scenario.obstacles]
    known = [(ours, theirs) for ours, theirs in entropies if ours is not None and theirs is not None]
    entropy = paired([ours - theirs for ours, theirs in known])
    accepted = (
        success["mean"] is not None
        and entropy["mean"] is not None
        and success["mean"] >= -SUCCESS_MARGIN
        and abs(entropy["mean"]) <= ENTROPY_MARGIN
    )
    return {
        "success": success_share(outcomes),
        "success_difference": success,
        "route_entropy_bits": float(np.mean([ours for ours, _ in known])) if known else None,
        "route_entropy_difference_bits": entropy,
        "accepted": accepted,
    }


def line(label: str, result: dict, seconds: float) -> str:
    """A row of the table."""

    def difference(value: dict, scale: float, unit: str) -> str:
        if value["mean"] is None:
            return f"too few maps ({value['maps']})"
        return f"{scale * value['mean']:+.2f} ± {scale * value['standard_error']:.2f} {unit} ({value['maps']} maps)"

    entropy = result["route_entropy_bits"]
    return (
        f"{label:<16} {100 * result['success']:>6.1f} %  {difference(result['success_difference'], 100, 'points'):<34}"
        f" {'-' if entropy is None else f'{entropy:.3f}':>6}  "
        f"{difference(result['route_entropy_difference_bits'], 1, 'bit'):<32}"
        f" {'accepted' if result['accepted'] else 'refused':<9} {seconds:>7.0f} s"
    )


def main() -> None:
    """Prints one line a sampler; writes everything as JSON where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkpoint", type=Path, help="checkpoint folder, or that of a run")
    parser.add_argument("--maps", nargs="+", default=["holdout", "unseen"], choices=sorted(MAP_SETS))
    parser.add_argument("--limit", type=int, help="only the first N maps of each set, for a quick look")
    parser.add_argument("--every", type=int, default=1, help="only every Nth map, where plans are slow (default: 1)")
    parser.add_argument("--repeats", type=int, default=8, help="episodes a map (default: 8)")
    parser.add_argument("--backend", default="torch", choices=("torch", "onnx", "numba"), help="default: torch")
    parser.add_argument("--initial-noise-scale", type=float, help="default: the checkpoint's")
    parser.add_argument("--step-limit", type=int, default=2000, help="30 Hz steps until a time-out (default: 2000)")
    parser.add_argument("--seed", type=int, default=0, help="of the noise (default: 0)")
    parser.add_argument("--out", type=Path, help="where the figures go, as JSON")
    arguments = parser.parse_args()
    chosen = {name: MAP_SETS[name][: arguments.limit : arguments.every] for name in arguments.maps}
    maps = [config for configs in chosen.values() for config in configs]
    noise = arguments.initial_noise_scale
    settings = {} if noise is None else {"initial_noise_scale": noise}
    results, reference, described = {}, [], {}
    print(f"{len(maps)} maps, {arguments.repeats} repeats; differences to DDPM-100 within maps, ± standard error")
    for sampler, steps in (REFERENCE, *SAMPLERS):
        sampling = {"sampler": sampler, "num_inference_steps": steps, "backend": arguments.backend, **settings}
        policy = Checkpoint(arguments.checkpoint, settings=sampling)
        policy.n_action_steps = policy.n_predicted_actions = 8  # as many as the study executes
        begin = time.perf_counter()
        with progress_bar(len(maps) * arguments.repeats, "episodes") as bar:
            outcomes = coplan(
                policy,
                maps,
                Physics(step_limit=arguments.step_limit),
                repeats=arguments.repeats,
                seed=arguments.seed,
                on_step=lambda finished, bar=bar: bar.update(finished - bar.n),
            )
        seconds = time.perf_counter() - begin
        reference = reference or outcomes
        described = described or policy.describe()
        label = f"{sampler} {steps}"
        results[label] = {**compare(outcomes, reference), "seconds": seconds}
        print(line(label, results[label], seconds), flush=True)
    if arguments.out is not None:
        document = {
            "label": "co-planning in simulation: no person took part",
            "policy": {k: v for k, v in described.items() if k not in ("sampler", "num_inference_steps")},
            "maps": {name: len(configs) for name, configs in chosen.items()},
            "settings": {name: getattr(arguments, name) for name in ("repeats", "seed", "step_limit", "backend")},
            "margins": {"success": SUCCESS_MARGIN, "route_entropy_bits": ENTROPY_MARGIN},
            "samplers": results,
        }
        arguments.out.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
