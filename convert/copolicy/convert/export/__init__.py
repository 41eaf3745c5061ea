"""Exports data sets of this project to the formats of diffusion_policy, robomimic and Minari."""
