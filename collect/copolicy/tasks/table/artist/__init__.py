"""Draws the table on its map: on a surface, and as a scene of Foxglove and Rerun."""
