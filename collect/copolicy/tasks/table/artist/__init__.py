"""Draws the table on its map: on a pygame surface, and as scenes for Foxglove and Rerun."""
