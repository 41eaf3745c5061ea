"""Named sets of settings of the VRNN planner."""

from typing import Any

_DEFAULT: dict[str, Any] = {
    "observation_features": "points",
    "mirror": False,
    "permute_obstacles": False,
    "window_frames": 60,
    "stride": 5,
    "encoded_frames": 60,
    "plan_frames": 90,
    "lookahead_frames": 30,
    "observe_pose": True,
    "motion_axes": "body",
    "scaled_rows": True,
    "heading_on_circle": True,
    "predicted": "motion",
    "loss_balance": "frame",
    # One rise: after the last of several, a decaying learning rate is too small for the prior to follow the encoder.
    "kl_cycles": 1,
    "kl_ramp": 0.25,
    "zero_history": False,
    "repeat_last_obstacle": False,
    "controller": "velocity",
    "unit_force": False,
    "wrapped_angle": True,
    "optimizer_weight_decay": 1e-6,
    "optimizer_grad_clip_norm": 1.0,
}

_SCAN: dict[str, Any] = {
    **_DEFAULT,
    "observation_features": "scan",
    "mirror": True,
    "permute_obstacles": True,
    "observe_pose": False,  # the scan has it
    "motion_axes": "scene",  # those of the scan
}

# The planner of the co-policy paper (2023): published settings, and the defects that shaped its behaviour.
_PAPER: dict[str, Any] = {
    **_DEFAULT,
    "window_frames": 120,
    "stride": 1,
    "encoded_frames": 30,
    "plan_frames": 130,
    "lookahead_frames": 120,
    "observe_pose": False,
    "motion_axes": "scene",
    "scaled_rows": False,
    "heading_on_circle": False,
    "predicted": "row",
    "loss_balance": "published",
    "kl_cycles": 4,
    "kl_ramp": 0.5,
    "zero_history": True,
    "repeat_last_obstacle": True,
    "controller": "proportional",
    "unit_force": True,
    "wrapped_angle": False,
    "optimizer_weight_decay": 0.2,
    "optimizer_grad_clip_norm": 0.0,
}

PRESETS: dict[str, dict[str, Any]] = {"default": _DEFAULT, "scan": _SCAN, "paper": _PAPER}
