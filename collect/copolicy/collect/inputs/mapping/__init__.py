"""Gamepad mappings: SDL's and the user's, from buttons and axes to controls, and the labels printed on the buttons."""

from .labels import Labels
from .mapping import UNKNOWN, Binding, GamepadMapping
from .mapping_run import MappingRun
from .mapping_store import MappingStore

__all__ = ["UNKNOWN", "Binding", "GamepadMapping", "Labels", "MappingRun", "MappingStore"]
