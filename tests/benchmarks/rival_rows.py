"""Rows of the comparison of the paper's methods: settings of a method, each with its budget on a CPU."""

from collections.abc import Mapping
from typing import Any

from training_study import Row, policy_flags

_RIVALS_HZ = 30  # frames a second of the paper's rivals

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

# With scaled inputs 0.6 M windows at 1e-3 with a decay do no worse than 1.5 M at robomimic's constant 1e-4 (seed 0).
_BC_RATE = policy_flags(optimizer_lr=1e-3, scheduler_final_lr_fraction=0)
_NO_VELOCITY = policy_flags(masked_state=["vx", "vy", "omega"])


def _recipe(preset: str) -> str:
    """Data of one order for presets with the scan."""
    return "pairs-sim-376" if preset in ("scan", "cnn-small") else _ORDERS


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


def _cnn(preset: str, steps: int = 5_000, recipe: str | None = None, **changed: object) -> Row:
    return Row(policy_flags(**changed), preset, recipe or _recipe(preset), steps, 256, bf16=False)


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
    "cnn-small-paper": _cnn("cnn-small", 3_200, _ORDERS, **_PAPER_INPUTS),
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
