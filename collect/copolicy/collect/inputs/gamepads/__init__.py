"""What the buttons and axes of a gamepad mean: SDL's mappings, the user's own, and the labels printed on the pad."""

from .labels import Labels
from .mapping import UNKNOWN, Binding, GamepadMapping
from .mapping_run import MappingRun
from .mapping_store import MappingStore

__all__ = ["UNKNOWN", "Binding", "GamepadMapping", "Labels", "MappingRun", "MappingStore"]
