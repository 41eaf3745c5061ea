"""Training steps of the co-policy in float32 and in bf16, samples a second, on one thread, in one run.

    taskset -c 0 uv run python tests/benchmarks/training_speed.py
    uv run python tests/benchmarks/training_speed.py --device cuda

A step is what LeRobot's trainer does: forward under autocast, backward, clipping, AdamW, the moving average. The batch
comes from the loader in memory; on a GPU it is gathered there. Rounds of both kinds alternate and medians are
compared, and on a CPU the process's own time counts, since the speed of a shared machine moves. No GPU was at hand when
this was written: `--device cuda` has not been run.
"""

import argparse
import statistics
import time
from collections.abc import Callable

import torch
from lerobot.configs import FeatureType, PolicyFeature

from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, FEATURES, HUMAN_ACTION, STATE
from copolicy.train.frame_table import FrameTable
from lerobot_policy_copolicy.copolicy.configuration_copolicy import CopolicyConfig
from lerobot_policy_copolicy.copolicy.modeling_copolicy import CopolicyPolicy

_KINDS = {STATE: FeatureType.STATE, ENVIRONMENT_STATE: FeatureType.ENV, HUMAN_ACTION: FeatureType.STATE}
_NETWORKS = {
    "MLP 3x384 (small)": ({"preset": "small"}, 512),
    "transformer 4x128": ({"preset": "default", "n_layers": 4, "width": 128, "feedforward_width": 512}, 256),
    "transformer 8x256 (default)": ({"preset": "default"}, 256),
}
_FRAMES = 20_000


def main() -> None:
    """Runs the comparison and prints a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=2.0, help="of a round, at least (default: 2)")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    device = torch.device(arguments.device)
    print(f"{device.type}, one thread, {arguments.rounds} rounds; samples/s (median of rounds)", flush=True)
    print(f"{'network':<28} {'parameters':>10} {'batch':>6} {'float32':>10} {'bf16':>10} {'bf16 / float32':>15}")
    for name, (settings, size) in _NETWORKS.items():
        policy = _policy(settings, device)
        steps = {mixed: _make_step(policy, size, device, mixed) for mixed in (False, True)}
        rates: dict[bool, list[float]] = {False: [], True: []}
        for step in steps.values():
            step()  # allocations and the choice of kernels
        for _ in range(arguments.rounds):
            for mixed, step in steps.items():
                rates[mixed].append(size * _rate(step, arguments.seconds, device))
        full, half = (statistics.median(rates[mixed]) for mixed in (False, True))
        count = sum(parameter.numel() for parameter in policy.denoiser.parameters())
        print(f"{name:<28} {count:>10,} {size:>6} {full:>10,.0f} {half:>10,.0f} {half / full:>15.2f}", flush=True)


def _policy(settings: dict, device: torch.device) -> CopolicyPolicy:
    config = CopolicyConfig(
        device=device.type,
        input_features={key: PolicyFeature(kind, FEATURES[key]["shape"]) for key, kind in _KINDS.items()},
        output_features={ACTION: PolicyFeature(FeatureType.ACTION, FEATURES[ACTION]["shape"])},
        **settings,
    )
    return CopolicyPolicy(config).to(device).train()


def _make_step(policy: CopolicyPolicy, size: int, device: torch.device, mixed: bool) -> Callable[[], None]:
    """One update of the policy on a random batch; float32 and bf16 share the weights."""
    config = policy.config
    frames = torch.arange(_FRAMES)
    columns = {key: torch.rand(_FRAMES, *FEATURES[key]["shape"]) for key in (*_KINDS, ACTION)}
    windows = {
        **dict.fromkeys(_KINDS, config.observation_delta_indices),
        ACTION: config.action_delta_indices,
    }
    table = FrameTable(columns, (frames // 500 * 500, frames // 500 * 500 + 499), windows).to(device)
    optimizer = config.get_optimizer_preset().build(policy.get_optim_params())
    order = torch.Generator().manual_seed(0)

    def step() -> None:
        rows = torch.randint(_FRAMES, (size,), generator=order)
        batch = table.batch(rows.to(device), rows.tolist())
        with torch.autocast(device.type, torch.bfloat16, enabled=mixed):
            loss, _ = policy.forward(batch)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(policy.denoiser.parameters(), 10.0)
        optimizer.step()
        optimizer.zero_grad()
        policy.update()

    return step


def _rate(step: Callable[[], None], seconds: float, device: torch.device) -> float:
    """Steps a second over at least some seconds; of one thread on a CPU its own seconds, whoever shares the core."""
    clock = time.process_time if device.type == "cpu" else time.perf_counter
    steps, start = 0, clock()
    while clock() - start < seconds or not steps:
        step()
        steps += 1
        if device.type == "cuda":
            torch.cuda.synchronize()
    return steps / (clock() - start)


if __name__ == "__main__":
    main()
