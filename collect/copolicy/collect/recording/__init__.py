"""Writes an episode while it happens, and completes what broke off."""
