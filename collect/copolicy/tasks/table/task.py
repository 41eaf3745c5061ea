"""The task of carrying a table; see `PairTask` for each part."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.features import GYM_ID
from copolicy.dataset.scenarios import ScenarioName, ScenarioSet
from copolicy.dataset.task import PairTask, PolicyFeatures, SimulatedPlayers, TaskRules, TaskStatistics

from .dynamics import integrate
from .features import environment_state, format_sizes, map_from_vector, states_7, theta_of
from .interaction import interaction_force
from .map_config import MapConfig
from .maps import MAP_SETS, identify, turned
from .physics import Physics
from .reward import reward
from .routes import route_class
from .scene_outline import TableOutline
from .seats import TableSeats
from .spec import SPEC
from .studies import TableStudies

if TYPE_CHECKING:
    from copolicy.dataset.task_words import TaskWords

    from .artist.table_view import TableView
    from .map_files import MapFiles
    from .policy.motion import TableMotion
    from .recording import TableMessages
    from .world import TableWorld

_LIMITS = {math.pi / 2: "pi/2", math.pi / 8: "pi/8"}


class TableTask(PairTask):
    """Two players carry a table past obstacles to a goal (Ng, Liu and Kennedy, RA-L 2023)."""

    spec = SPEC
    settings_type = Physics
    exchange = TableSeats()
    outline = TableOutline()
    studies = TableStudies()
    orientations = 4

    @property
    def agents(self) -> SimulatedPlayers:
        """Scripted pairs, partners and robots."""
        from .agents.players import SCRIPTED_PLAYERS

        return SCRIPTED_PLAYERS

    @property
    def scenario_sets(self) -> Mapping[str, Sequence[MapConfig]]:
        """The map sets."""
        return MAP_SETS

    def scenario_of_json(self, text: str | bytes) -> MapConfig:
        """See `MapConfig.from_json`."""
        return MapConfig.from_json(text)

    def scenario_vector(self, scenario: MapConfig) -> Array:
        """`(11,)` start pose, goal, and the centres of the obstacles padded with zeros."""
        return environment_state(scenario)

    def scenario_of_vector(self, vector: Array, columns: Mapping[str, Any]) -> MapConfig:
        """The map of an `environment_state`, with the obstacle sizes of the episode columns.

        Data sets of earlier versions have no such columns: there the map's name decides, and the default is 50 px.
        """
        paper = str(columns.get("map_id", "")).startswith(("holdout", "unseen"))
        size = columns.get("obstacle_size") or (45 if paper else MapConfig.obstacle_size)
        return map_from_vector(vector, size, columns.get("obstacle_sizes") or "")

    def columns_of(self, scenario: MapConfig) -> dict[str, Any]:
        """The columns `obstacle_size` and `obstacle_sizes`."""
        return {"obstacle_size": scenario.obstacle_size, "obstacle_sizes": format_sizes(scenario)}

    def unseen(self, columns: Mapping[str, Any]) -> str:
        """Obstacle sizes that differ: the vector has centres only, and the range scan assumes 50 px for all."""
        sizes = columns.get("obstacle_sizes")
        return f"the size of each obstacle, where they differ ({sizes} px)" if sizes else ""

    def make_world(self, scenario: MapConfig, settings: Physics | None = None) -> "TableWorld":
        """A table at rest at the start of a map."""
        from .world import TableWorld  # pymunk

        return TableWorld(scenario, settings)

    def start_of(self, scenario: MapConfig) -> tuple[float, ...]:
        """At rest at the start of the map, with the map's orientation."""
        return (*scenario.start, 0.0, 0.0, 0.0)

    def states_of(self, recorded: Array) -> Array:
        """`(T, 6)` x, y, theta and velocity to `(T, 7)`, bit for bit as `TableWorld.observation`."""
        thetas = recorded[:, 2].tolist()
        states = np.empty((len(recorded), 7))
        states[:, :2] = recorded[:, :2]
        states[:, 2] = [math.cos(theta) for theta in thetas]
        states[:, 3] = [math.sin(theta) for theta in thetas]
        states[:, 4:] = recorded[:, 3:]
        return states

    def recorded_of(self, states: Array) -> Array:
        """`(T, 7)` to `(T, 6)` x, y, theta and velocity."""
        return np.column_stack((states[:, :2], theta_of(states), states[:, 4:]))

    def rewards(self, scenario: MapConfig, states: Array) -> Array:
        """See `reward`; the position alone matters."""
        return np.array([reward(x, y, scenario) for x, y in states[:, :2].tolist()])

    def integrate(self, scenario: MapConfig, settings: Physics, state: Array, actions: Array) -> Array:
        """By `dynamics.integrate`, which is much faster than `TableWorld`, since it does not check contacts."""
        x, y, _, _, vx, vy, omega = state.astype(float).tolist()
        return states_7(integrate((x, y, float(theta_of(state))), (vx, vy, omega), actions, settings))

    def path(self, states: Array) -> Array:
        """`(T, 2)` the table's centre, px."""
        return states[:, :2]

    def interaction(self, states: Array, actions: Array) -> Array:
        """See `interaction_force`."""
        return interaction_force(theta_of(states), actions)

    def interaction_recorded(self, recorded: Array, actions: Array) -> Array:
        """By the recorded orientation, without the detour through its cosine and sine."""
        return interaction_force(recorded[:, 2], actions)

    def layout(self, scenario: MapConfig, with_goal: bool = False) -> tuple:
        """The sorted obstacles, and the goal."""
        # Sizes count only where they differ, since a common size depends on the map set alone.
        sizes = scenario.obstacle_sizes or (0,) * len(scenario.obstacles)
        obstacles = sorted((x, y, size) for (x, y), size in zip(scenario.obstacles, sizes, strict=True))
        return tuple(obstacles), scenario.goal if with_goal else ()

    def strategy(self, scenario: MapConfig, states: Array) -> str:
        """See `route_class`."""
        return route_class(states[:, :2], scenario)

    def environment(self, settings: Mapping[str, float]) -> tuple[str, dict[str, Any]]:
        """The table's own gymnasium environment."""
        names = ("step_limit", "angular_acceleration_limit")
        return GYM_ID, {name: settings[name] for name in names if name in settings}

    @property
    def words(self) -> "TaskWords":
        """Words for the table and its maps."""
        from .words import WORDS

        return WORDS

    def images(self, scenario: MapConfig, states: Array, size: tuple[int, int]) -> Iterator[Array]:
        """Images by `SceneImage`."""
        from .artist.scene_image import scene_image  # pygame

        image = scene_image(scenario, size)
        for (x, y), theta in zip(states[:, :2].tolist(), theta_of(states).tolist(), strict=True):
            yield image.draw((x, y, theta))

    def view(self, scenario: MapConfig) -> "TableView":
        """Draws the floor, the map and the table on a screen."""
        from .artist.table_view import TableView  # pygame

        return TableView(scenario)

    @property
    def drift_limits(self) -> Mapping[str, float]:
        """Limits of position and orientation; rounding of doubles stays below 1e-9."""
        return {"px": 0.01, "rad": 1e-4}

    def drift(self, recorded: Array, reference: Array) -> Array:
        """Distance of the positions, px, and of the orientations, rad in [0, pi]."""
        turn = recorded[:, 2] - reference[:, 2]
        rad = np.abs((turn + math.pi) % (2 * math.pi) - math.pi)
        return np.column_stack((np.linalg.norm(recorded[:, :2] - reference[:, :2], axis=1), rad))

    def displaced(self, scenario: MapConfig, scale: float, rng: np.random.Generator) -> MapConfig:
        """See `displaced_start`."""
        from .start_pose import displaced_start  # pymunk

        return displaced_start(scenario, scale, rng)

    def balanced(self, scenario: MapConfig) -> tuple:
        """Balances start and goal."""
        return scenario.start, scenario.goal

    @property
    def recording(self) -> "TableMessages":
        """Messages of the table."""
        from .recording import TableMessages  # protobuf

        return TableMessages()

    @property
    def rules(self) -> TaskRules:
        """Rules for map, motion and contacts."""
        from .rules import RULES

        return RULES

    @property
    def statistics(self) -> TaskStatistics:
        """Statistics of the sides of obstacles, distance to people's routes, and dip test of the steering."""
        from .statistics import STATISTICS  # scipy, diptest

        return STATISTICS

    @property
    def features(self) -> PolicyFeatures:
        """Encoders of the map relative to the table; mirror and permutation symmetries."""
        from .policy import POLICY_FEATURES  # torch

        return POLICY_FEATURES

    @property
    def motion(self) -> "TableMotion":
        """Kinematics, dynamics and rewards of the table."""
        from .policy.motion import TableMotion  # torch

        return TableMotion()

    def settings_summary(self, settings: Physics) -> str:
        """The bound on the angular acceleration, and all other settings that differ from the default."""
        limit = settings.angular_acceleration_limit
        default = asdict(Physics(angular_acceleration_limit=limit))
        changed = [f"{name} {value:g}" for name, value in asdict(settings).items() if value != default[name]]
        return ", ".join([f"angular acceleration up to {_LIMITS.get(limit, f'{limit!r}')} rad/s^2", *changed])

    def identify(self, scenario: MapConfig) -> tuple[str, str]:
        """See `maps.identify`."""
        return identify(scenario)

    def name_of(self, scenario: MapConfig) -> ScenarioName:
        """The name of a map from a file, else the name by `identify`."""
        return scenario.named or super().name_of(scenario)

    @property
    def scenario_files(self) -> "MapFiles":
        """Files of maps in YAML or JSON."""
        from .map_files import MapFiles  # PyYAML

        return MapFiles()

    def turned(self, scenario_set: ScenarioSet) -> ScenarioSet:
        """See `maps.turned`."""
        return turned(scenario_set)
