"""Reads LeRobot v3 data set folders. This file imports nothing, so that other commands start fast."""
