"""The variational recurrent planner of body motion (Ng et al., "It Takes Two", ICRA 2023), as a LeRobot policy."""

from .configuration_vrnn import VrnnConfig

__all__ = ["VrnnConfig"]
