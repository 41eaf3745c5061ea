"""Rules of `copolicy-dataset check` for the table: maps, motion and contacts."""

from copolicy.dataset.task_parts import Limit, TaskRules

from . import contacts, maps, motion

LIMITS = {
    "jump": Limit(
        52.0, "px/s", "terminal speed of an axis under two full forces is 50 px/s; 4 % for other integrators"
    ),
    "drift.warning": Limit(1.0, "px", "contacts are decided to a pixel; our own recordings replay below 1e-6"),
    "drift.error": Limit(10.0, "px", "a third of the table's width: the replay passes obstacles differently"),
    "state_range": None,
    "unit_circle": Limit(1e-3, "1", "cos^2 + sin^2 is 1 up to single precision"),
    "idle_run": Limit(5.0, "s", "people pause to negotiate, but rarely this long while they carry"),
    "stuck_speed": Limit(2.0, "px/s", "4 % of the table's terminal speed"),
    "stuck": Limit(5.0, "s", "a table at rest for this long is blocked, or the players are absent"),
    "unmoved": Limit(20.0, "px", "a tenth of the table's length: nothing was carried"),
    "map_position": Limit(1.0, "px", "maps are stored in single precision"),
    "map_start": Limit(5.0, "px", "a table at rest moves less than this in the first frame"),
    "contact_margin": Limit(2.0, "px", "two pixel grids, and the image's rounded corners"),
}

RULES = TaskRules((*motion.RULES, *maps.RULES, *contacts.RULES), LIMITS)
