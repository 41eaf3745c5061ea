"""Writes and extends LeRobot v3 data sets."""
