"""Time of one decision of each method, beside the paper's; one thread, one table at a time.

    uv run python tests/benchmarks/planning_methods.py
    uv run python tests/benchmarks/planning_methods.py --runs CoDP-H=outputs/codp-h BC=outputs/bc
    uv run python tests/benchmarks/planning_methods.py --only bc vrnn --rounds 200

A decision is from the observation (numpy) to the action (numpy) on the CPU, with processors and scaling, as the studies
and `play` call a policy. Without `--runs` the weights are random: the time is the same. Rounds are interleaved, so that
other load falls on all methods alike, and each call is timed after one of the same method, as in a control loop.

A method that acts frame by frame may plan at every k-th frame only: `mean` is over all its calls, `planning calls` over
those that plan. Methods that this version does not have are named and left out.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"  # before torch is imported

import argparse
import json
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.configs import FeatureType, PolicyFeature, PreTrainedConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from lerobot.utils.import_utils import register_third_party_plugins
from rival_rows import ACT_NETWORK, DIFFUSION_NETWORK

from copolicy.dataset.exceptions import CopolicyError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE, bounds_of, features_of
from copolicy.dataset.task import get_task
from copolicy.train.checkpoint import Checkpoint

TASK = get_task()
_KINDS = {STATE: FeatureType.STATE, ENVIRONMENT_STATE: FeatureType.ENV, HUMAN_ACTION: FeatureType.STATE}


@dataclass(frozen=True)
class Made:
    """A policy with random weights: type, settings, executed actions of a chunk, and upper limit of its time, ms."""

    type: str
    settings: dict[str, Any] = field(default_factory=dict)
    n_action_steps: int = 1
    limit_ms: float | None = None


_STEPS_34 = {"num_inference_steps": 34}
METHODS = {
    "CoDP-H, paper's network, DDPM-34": Made("copolicy", {"preset": "paper", **_STEPS_34}),
    "CoDP, paper's network, DDPM-34": Made("copolicy", {"preset": "paper", "past_human_action": False, **_STEPS_34}),
    "CoDP-H, paper's network, DDPM-100": Made("copolicy", {"preset": "paper"}, 8),
    "CoDP-H, default (DDIM-10)": Made("copolicy", {"preset": "default"}),
    "CoDP-H, small (DDIM-10)": Made("copolicy", {"preset": "small"}),
    "CoDP, small (DDIM-10)": Made("copolicy", {"preset": "small", "past_human_action": False}),
    "CNN": Made("copolicy", {"preset": "cnn"}),
    "CNN, inpainting (DDIM-8)": Made("copolicy", {"preset": "cnn-inpainting"}),
    "CNN, small (DDIM-10)": Made("copolicy", {"preset": "cnn-small"}),
    "BC-LSTM-GMM": Made("bc_lstm_gmm", {"preset": "paper"}, limit_ms=1),
    "BC-LSTM-GMM, scan": Made("bc_lstm_gmm", {"preset": "scan"}, limit_ms=1),
    "Co-GAIL": Made("cogail", {"preset": "paper"}, limit_ms=1),
    "Co-GAIL, scan": Made("cogail", {"preset": "scan"}, limit_ms=1),
    "VRNN, paper": Made("vrnn", {"preset": "paper"}, limit_ms=40),
    "VRNN": Made("vrnn", {"preset": "default"}, limit_ms=40),
    "VRNN, scan": Made("vrnn", {"preset": "scan"}, limit_ms=40),
    "LeRobot's diffusion, narrow": Made("diffusion", dict(DIFFUSION_NETWORK), 8),
    "LeRobot's ACT, narrow": Made("act", dict(ACT_NETWORK), 8),
}


class Timed:
    """A policy and the times of its decisions."""

    def __init__(
        self, policy: Checkpoint, clock: Callable[[], float], n_action_steps: int, limit_ms: float | None = None
    ):
        self._policy, self._clock, self.limit_ms = policy, clock, limit_ms
        policy.n_action_steps = policy.n_predicted_actions = min(n_action_steps, policy.chunk_size)
        config = policy.policy.config
        self.period = int(getattr(config, "replan_frames", 1))
        self.parameters = sum(parameter.numel() for parameter in policy.policy.parameters() if parameter.requires_grad)
        settings = {"type": config.type, **vars(config)}
        self.published = next((m.planning_ms for m in TASK.studies.published if m.is_of(settings)), None)
        self.planning_ms: list[float] = []
        self.other_ms: list[float] = []
        self._frame, self._observations = 0, _observations(policy.n_obs_steps)
        policy.reset(0)

    def round(self) -> None:
        """One period of calls that are not timed, and one of calls that are."""
        for timed in (False, True):
            for frame in range(self.period):
                began = self._clock()
                self._policy.predict_action_chunk(self._observations)
                if timed:
                    (self.other_ms if frame else self.planning_ms).append(1e3 * (self._clock() - began))

    @property
    def all_ms(self) -> list[float]:
        """Times of all calls, ms."""
        return self.planning_ms + self.other_ms


def made_policy(made: Made, folder: Path) -> Checkpoint:
    """A policy with random weights, written and loaded like one that was trained.

    Raises:
        CopolicyError: this version does not have the policy or the preset.
        KeyError: likewise, for a type that is not registered.
    """
    features, bounds = features_of(TASK.spec), bounds_of(TASK.spec)
    config_type: Any = PreTrainedConfig.get_known_choices()[made.type]
    config = config_type(
        device="cpu",
        input_features={key: PolicyFeature(kind, features[key]["shape"]) for key, kind in _KINDS.items()},
        output_features={ACTION: PolicyFeature(FeatureType.ACTION, features[ACTION]["shape"])},
        **made.settings,
    )
    torch.manual_seed(0)
    get_policy_class(made.type)(config).save_pretrained(folder)
    stats = {key: _statistics(*bounds[key]) for key in (*_KINDS, ACTION)}  # for processors that scale
    for processor in make_pre_post_processors(config, dataset_stats=stats):
        processor.save_pretrained(folder)
    return Checkpoint(folder)


def _statistics(low: np.ndarray, high: np.ndarray) -> dict[str, torch.Tensor]:
    values = {"min": low, "max": high, "mean": (low + high) / 2, "std": high - low}
    return {name: torch.from_numpy(value).float() for name, value in values.items()}


def _observations(frames: int) -> dict[str, np.ndarray]:
    scenario = next(iter(TASK.scenario_sets.values()))[0]
    state = TASK.states_of(np.array([TASK.start_of(scenario)]))[0]
    columns = {
        STATE: state,
        ENVIRONMENT_STATE: TASK.scenario_vector(scenario),
        HUMAN_ACTION: np.zeros(len(TASK.spec.action)),
    }
    return {key: np.repeat(values[None, None], frames, axis=1) for key, values in columns.items()}


def table(timed: dict[str, Timed]) -> str:
    """The times as a Markdown table."""
    lines = [
        "| method | parameters | p50, ms | mean, ms | p95, ms | planning calls, mean, ms | paper, ms | limit, ms |",
        "|---|---:|---:|---:|---:|---:|---:|---|",
    ]
    for name, method in timed.items():
        times = method.all_ms
        p50, mean, p95 = statistics.median(times), statistics.mean(times), np.quantile(times, 0.95)
        planning = statistics.mean(method.planning_ms)
        every = f"{planning:.3g} (1 of {method.period})" if method.period > 1 else ""
        limit = (
            "" if method.limit_ms is None else f"{method.limit_ms:g}: {'yes' if planning < method.limit_ms else 'no'}"
        )
        lines.append(
            f"| {name} | {method.parameters:,} | {p50:.3g} | {mean:.3g} | {p95:.3g} | {every} | "
            f"{method.published or ''} | {limit} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", nargs="+", metavar="NAME=RUN", help="trained policies instead of random weights")
    parser.add_argument(
        "--only", nargs="+", metavar="TEXT", help="only methods whose name or type has one of the texts"
    )
    parser.add_argument("--rounds", type=int, default=15, help="interleaved rounds (default: 15)")
    parser.add_argument(
        "--cpu-time", action="store_true", help="the thread's own time, where others use the machine; no latency then"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write all times")
    arguments = parser.parse_args()
    clock = time.thread_time if arguments.cpu_time else time.perf_counter
    torch.set_num_threads(1)
    register_third_party_plugins()
    timed: dict[str, Timed] = {}
    if arguments.runs:
        for text in arguments.runs:
            name, _, run = text.partition("=")
            policy = Checkpoint(run or name)
            timed[name] = Timed(policy, clock, 8 if policy.chunk_size > 1 else 1)
    else:
        with tempfile.TemporaryDirectory() as folder:
            for name, made in METHODS.items():
                texts = [text.lower() for text in arguments.only or [""]]
                if not any(text in name.lower() or text in made.type for text in texts):
                    continue
                try:
                    policy = made_policy(made, Path(folder) / f"{len(timed)}")
                except (CopolicyError, KeyError) as error:
                    print(f"{name}: left out, {error}")
                    continue
                timed[name] = Timed(policy, clock, made.n_action_steps, made.limit_ms)
    for method in timed.values():  # compiles and fills tables
        method.round()
        method.planning_ms, method.other_ms = [], []
    for _ in range(arguments.rounds):
        for method in timed.values():
            method.round()
    print(table(timed))
    if arguments.json:
        times = {name: {"planning_ms": m.planning_ms, "other_ms": m.other_ms} for name, m in timed.items()}
        arguments.json.write_text(json.dumps(times, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
