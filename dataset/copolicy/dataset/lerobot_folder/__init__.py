"""Reads LeRobot v3 data set folders. This file imports nothing, which keeps the start of other commands fast."""
