"""Training steps of the co-policy in float32 and in bf16, samples a second, on one thread, in one run.

    taskset -c 0 uv run python tests/benchmarks/training_speed.py
    uv run python tests/benchmarks/training_speed.py --device cuda --compile --networks default --batch 256 1024 4096

A step is what LeRobot's trainer does: forward under autocast, backward, clipping, AdamW, the moving average. The batch
comes from the loader in memory; on a GPU it is gathered there. Rounds of all kinds alternate and medians are
compared, and on a CPU the process's own time counts, since the speed of a shared machine moves. On a GPU the share of
the card's peak is given too: floating-point operations of the matrix products, forward and backward, a second, over
those that a product of two 8192 x 8192 bf16 matrices reached in the same run.
"""

import argparse
import statistics
import time
from collections.abc import Callable

import torch
from lerobot.configs import FeatureType, PolicyFeature
from torch.utils.flop_counter import FlopCounterMode

from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.tasks.table.features import FEATURES
from copolicy.train.frame_tensors import FrameTensors
from lerobot_policy_copolicy.copolicy.configuration_copolicy import CopolicyConfig
from lerobot_policy_copolicy.copolicy.modeling_copolicy import CopolicyPolicy

_KINDS = {STATE: FeatureType.STATE, ENVIRONMENT_STATE: FeatureType.ENV, HUMAN_ACTION: FeatureType.STATE}
_NETWORKS = {
    "small": ({"preset": "small"}, 512),  # residual MLP, 3 blocks of 384
    "transformer-4x128": ({"preset": "default", "n_layers": 4, "width": 128, "feedforward_width": 512}, 256),
    "default": ({"preset": "default"}, 256),  # the paper's transformer, 8 layers of 256
}
_KINDS_OF_STEP = ("float32", "bf16", "bf16 compiled")
_FRAMES = 20_000


def main() -> None:
    """Runs the comparison and prints a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--networks", nargs="+", choices=_NETWORKS, default=list(_NETWORKS))
    parser.add_argument("--batch", nargs="+", type=int, help="frames of a step (default: 512 or 256, by network)")
    parser.add_argument("--compile", action="store_true", help="also with --policy.compile_model=true")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=2.0, help="of a round, at least (default: 2)")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    torch.backends.cuda.matmul.allow_tf32 = True  # as LeRobot's trainer sets it
    device = torch.device(arguments.device)
    print(f"{device.type}, one thread, {arguments.rounds} rounds; samples/s (median of rounds)", flush=True)
    peak = _matmul_rate(device) if device.type == "cuda" else None
    if peak is not None:
        print(f"{torch.cuda.get_device_name(device)}: bf16 matrix product {peak / 1e12:.0f} TFLOP/s", flush=True)
    kinds = _KINDS_OF_STEP if arguments.compile else _KINDS_OF_STEP[:-1]
    columns = "".join(f"{kind:>15}" for kind in kinds)
    print(f"{'network':<20} {'parameters':>10} {'batch':>6}{columns}  fastest / float32   MFLOP a sample  of the peak")
    for name in arguments.networks:
        settings, usual = _NETWORKS[name]
        for size in arguments.batch or [usual]:
            steps = {kind: _make_step(settings, size, device, kind) for kind in kinds}
            rates: dict[str, list[float]] = {kind: [] for kind in kinds}
            for step in steps.values():
                step()  # allocations, the choice of kernels, compilation
            for _ in range(arguments.rounds):
                for kind, step in steps.items():
                    rates[kind].append(size * _rate(step, arguments.seconds, device))
            medians = {kind: statistics.median(values) for kind, values in rates.items()}
            best = max(medians.values())
            policy = _policy(settings, device)
            count = sum(parameter.numel() for parameter in policy.denoiser.parameters())
            flops = _flops_of_a_sample(policy, device)
            share = "" if peak is None else f"{100 * best * flops / peak:.1f} %"
            shown = "".join(f"{medians[kind]:>15,.0f}" for kind in kinds)
            ratio = best / medians["float32"]
            print(
                f"{name:<20} {count:>10,} {size:>6}{shown} {ratio:>17.2f} {flops / 1e6:>17.1f} {share:>12}", flush=True
            )


def _policy(settings: dict, device: torch.device) -> CopolicyPolicy:
    config = CopolicyConfig(
        device=device.type,
        input_features={key: PolicyFeature(kind, FEATURES[key]["shape"]) for key, kind in _KINDS.items()},
        output_features={ACTION: PolicyFeature(FeatureType.ACTION, FEATURES[ACTION]["shape"])},
        **settings,
    )
    return CopolicyPolicy(config).to(device).train()


def _make_step(settings: dict, size: int, device: torch.device, kind: str) -> Callable[[], None]:
    """One update of a new policy on a random batch."""
    policy = _policy({**settings, "compile_model": kind == "bf16 compiled"}, device)
    mixed = kind != "float32"
    config = policy.config
    frames = torch.arange(_FRAMES)
    columns = {key: torch.rand(_FRAMES, *FEATURES[key]["shape"]) for key in (*_KINDS, ACTION)}
    windows = {
        **dict.fromkeys(_KINDS, config.observation_delta_indices),
        ACTION: config.action_delta_indices,
    }
    table = FrameTensors(columns, (frames // 500 * 500, frames // 500 * 500 + 499), windows).to(device)
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


def _flops_of_a_sample(policy: CopolicyPolicy, device: torch.device) -> float:
    """Operations of the matrix products of one sample, forward and backward."""
    size = 16
    batch = {key: torch.rand(size, policy.config.n_obs_steps, *FEATURES[key]["shape"], device=device) for key in _KINDS}
    batch[ACTION] = torch.rand(size, policy.config.horizon, *FEATURES[ACTION]["shape"], device=device)
    # Attention is counted only where it is a kernel that the counter knows; it is under a hundredth of the total here.
    with FlopCounterMode(display=False) as counter:
        policy.forward(batch)[0].backward()
    return counter.get_total_flops() / size


def _matmul_rate(device: torch.device) -> float:
    """Operations a second of a large bf16 matrix product."""
    one, other = (torch.randn(8192, 8192, device=device, dtype=torch.bfloat16) for _ in range(2))
    for _ in range(3):
        torch.mm(one, other)
    torch.cuda.synchronize()
    begin, rounds = time.perf_counter(), 20
    for _ in range(rounds):
        torch.mm(one, other)
    torch.cuda.synchronize()
    return rounds * 2 * 8192**3 / (time.perf_counter() - begin)


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
