"""Statistics of the table: sides of obstacles, distance to people's routes, and dip test of the steering."""

from copolicy.dataset.statistics.forces import FULL_FORCES
from copolicy.dataset.task_parts import TaskStatistics

from .human_routes import human_reference
from .route_statistics import route_statistics
from .steering_dip import dip_statistics

STATISTICS = TaskStatistics(
    people="people carried the table",
    velocity=(4, 5),
    interaction="Interaction force: half the difference of both players' forces along the table, in units of a "
    "player's full force; positive pulls apart.",
    interaction_unit=FULL_FORCES,
    label_bits=len,  # one letter an obstacle
    families={"routes": route_statistics, "actions": dip_statistics},
    reference=human_reference,
)
