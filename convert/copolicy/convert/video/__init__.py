"""The image of each frame, encoded as the video of a data set."""
