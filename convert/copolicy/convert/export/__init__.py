"""Data sets of this project out again, to the formats of diffusion_policy, robomimic and Minari."""
