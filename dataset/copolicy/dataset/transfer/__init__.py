"""Uploads a released data set to the Hub and downloads it again."""
