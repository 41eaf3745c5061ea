"""Encodes the image of each frame as the video of a data set."""
