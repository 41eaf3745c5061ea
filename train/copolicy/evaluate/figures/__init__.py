"""Figures of trajectories: visits, interaction, paths, and success by map, of several sources on common scales."""
