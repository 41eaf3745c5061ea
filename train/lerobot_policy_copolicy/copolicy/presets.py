"""Presets: named sets of values for settings of `CopolicyConfig` that are None."""

PRESETS: dict[str, dict] = {
    # The paper's settings, from its training configuration and its section IV.
    "paper": {
        "past_human_action": True,
        "network": "transformer",
        "n_layers": 8,
        "width": 256,
        "n_heads": 4,
        "feedforward_width": 1024,
        "attention_dropout": 0.3,
        "embedding_dropout": 0.0,
        "down_widths": (256, 512, 1024),
        "inpainting": False,
        "observation_features": "absolute",
        "mirror": False,
        "permute_obstacles": False,
        "prediction_type": "epsilon",
        "sampler": "ddpm",
        "num_inference_steps": 100,
        "timestep_spacing": "trailing",
        "initial_noise_scale": 1.0,
        "drop_n_last_frames": 9,
        "optimizer_lr": 1e-4,
        "optimizer_weight_decay": 1e-3,
        "optimizer_betas": (0.9, 0.95),
        "optimizer_grad_clip_norm": 0.0,
        "scheduler_warmup_steps": 1000,
        "scheduler_final_lr_fraction": 0.0,
    },
}

# The paper's network with changes that raise closed-loop success: it predicts the actions instead of the noise, goal
# and obstacles are relative to the table and seen by a range scan, the task's symmetries augment the data, and it
# samples with ten deterministic steps. Effects: train/docs/results.md.
PRESETS["default"] = {
    **PRESETS["paper"],
    "observation_features": "scan",
    "mirror": True,
    "permute_obstacles": True,
    "prediction_type": "sample",
    "sampler": "ddim",
    "num_inference_steps": 10,
    "drop_n_last_frames": 0,
    "optimizer_grad_clip_norm": 10.0,
}

# The same with a network that a laptop trains in minutes.
PRESETS["small"] = {
    **PRESETS["default"],
    "network": "mlp",
    "n_layers": 3,
    "width": 384,
    "attention_dropout": 0.0,
    "optimizer_lr": 1e-3,
    "optimizer_betas": (0.9, 0.999),
    "scheduler_warmup_steps": 200,
    "scheduler_final_lr_fraction": 0.01,
}

# The CNN of Diffusion Policy (Chi et al., 2023) for low-dimensional observations, with the paper's horizons.
PRESETS["cnn"] = {
    **PRESETS["paper"],
    "past_human_action": False,
    "network": "unet",
    "optimizer_weight_decay": 1e-6,
    "optimizer_betas": (0.95, 0.999),
    "scheduler_warmup_steps": 500,
}

# The training configuration of the CNN that the co-policy's authors released.
PRESETS["cnn-inpainting"] = {
    **PRESETS["cnn"],
    "inpainting": True,
    "sampler": "ddim",
    "num_inference_steps": 8,
    "timestep_spacing": "leading",
}

# "small" with a CNN of a size that a CPU trains.
PRESETS["cnn-small"] = {
    **PRESETS["small"],
    "network": "unet",
    "down_widths": (64, 128, 256),
}
