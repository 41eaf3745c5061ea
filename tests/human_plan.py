"""What the tests of plans, sessions and summaries of the study with people share."""

from copolicy.evaluate.human_study.plan import Robot
from copolicy.tasks.table.map_config import MapConfig

SHORT = tuple(MapConfig((803.0, y, 3.14), (960.0, y)) for y in (250.0, 350.0))
"""Straight ahead, about a second away."""

ROBOTS = (Robot("CoDP-H", "a", "1"), Robot("CoDP", "b", "2"))
