"""The gymnasium environment of the table-carrying task."""

import math
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec

from copolicy.collect.agents import HeldAgent, ScriptedAgent
from copolicy.collect.agents.scripted import simulated_players
from copolicy.collect.rollout import Rollout, Trace
from copolicy.dataset.clock import frames, stride
from copolicy.dataset.exceptions import InvalidValueError, ShapeError, UnknownNameError
from copolicy.dataset.features import OBSERVATION_KEYS, SCENE_SIZE
from copolicy.dataset.task import get_task
from copolicy.tasks.table.features import BOUNDS, environment_state, theta_of
from copolicy.tasks.table.interaction import interaction_force
from copolicy.tasks.table.map_config import WINDOW, MapConfig
from copolicy.tasks.table.physics import Physics

from .configuration_table_carrying import require_image_size

_TASK = "table_carrying"


class TableCarryingEnv(gymnasium.Env):
    """Two players carry a table past obstacles to a goal.

    ## Action space
    `Box(-1, 1, (4,), float32)`: robot_fx, robot_fy, human_fx, human_fy in units of a player's full force, x to the
    right, y down. Held for 30 / fps steps of the world. With a simulated `partner` it is `Box(-1, 1, (2,), float32)`,
    the robot's half: the partner acts for the human, at every step of the world.

    ## Observation space
    A `Dict` of float32 in px, rad and s, under the names that LeRobot knows:

    | key | shape | LeRobot column |
    |---|---|---|
    | agent_pos | (7,) | observation.state: x, y, cos_theta, sin_theta, vx, vy, omega |
    | environment_state | (11,) | observation.environment_state: start pose, goal, three obstacles padded with zeros |
    | human_action | (2,) | observation.human_action: what the human did in the previous frame, zero at the first |
    | pixels | {"scene": (height, width, 3) uint8}, with `pixels=True` only | observation.images.scene |

    ## Reward
    Of the state that the frame ends in (`copolicy.tasks.table.reward`).

    ## Success
    The table touches the goal square; `info["is_success"]` tells at every step.

    ## Termination
    The goal, an obstacle or a wall is touched, also within a frame; `info["termination_reason"]` tells which.
    Truncated after `step_limit` steps of the world, for the reason `timeout`; that is the frame
    `ceil(step_limit * fps / 30)`. A `max_episode_steps` of `gymnasium.make` comes on top and gives no reason.

    ## Starting state
    At rest at the start of a map. `reset(seed=s)` takes map `s % maps`, `reset(options={"map_index": i})` map i, and
    a bare `reset()` the next one.

    Args:
        fps: actions a second, a divisor of 30.
        map_set: name of a set of maps, a file of maps, or one of its splits as `FILE#split`.
        orientations: start each map in four orientations.
        step_limit: steps of 1/30 s after which an episode is truncated.
        angular_acceleration_limit: rad/s^2.
        partner: simulated pair whose human plays the human half; empty for none.
        pixels: observe the image of the scene too, as `copolicy-convert mcap --video` draws it.
        observation_width: of the image, px.
        observation_height: of the image, px.
        render_mode: "rgb_array" or None.

    Raises:
        UnknownNameError: no such map set or pair.
        InvalidValueError: `fps` does not divide 30, or a limit or a size that cannot be.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 (as gymnasium declares it)

    def __init__(
        self,
        fps: int = 10,
        map_set: str = "training",
        orientations: bool = False,
        step_limit: int = 1000,
        angular_acceleration_limit: float = math.pi / 2,
        partner: str = "",
        pixels: bool = False,
        observation_width: int = SCENE_SIZE[0],
        observation_height: int = SCENE_SIZE[1],
        render_mode: str | None = "rgb_array",
    ):
        self.metadata = {**type(self).metadata, "render_fps": fps}
        self.render_mode = render_mode
        self.task, self.task_description = _TASK, "Carry the table to the goal together."
        chosen = get_task().scenario_set(map_set)
        self.maps = (get_task().turned(chosen) if orientations else chosen).scenarios
        self.physics = Physics(angular_acceleration_limit, step_limit)
        self.partner = partner
        self._spec: EnvSpec | None = None
        self._stride = stride(fps)
        self._next_map = 0
        self._max_episode_steps = frames(step_limit, fps)  # by this name LeRobot asks for it
        if partner:
            _check_pair(partner)
        self._action_shape = (2,) if partner else (4,)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, self._action_shape, np.float32)
        spaces: dict[str, gymnasium.Space] = {key: _box(column) for key, column in OBSERVATION_KEYS.items()}
        shape = require_image_size(observation_width, observation_height)
        self._image_size = (observation_width, observation_height) if pixels else None
        if pixels:
            spaces["pixels"] = gymnasium.spaces.Dict({"scene": gymnasium.spaces.Box(0, 255, shape, np.uint8)})
        self.observation_space = gymnasium.spaces.Dict(spaces)

    @property
    def spec(self) -> EnvSpec | None:
        """The registered specification, with the frames after which this environment truncates."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:  # pyright: ignore[reportIncompatibleVariableOverride]
        if spec is not None and spec.max_episode_steps is None:
            spec = replace(spec, max_episode_steps=self._max_episode_steps)
        self._spec = spec

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[dict, dict]:
        """Puts the table at the start of a map.

        Raises:
            InvalidValueError: `options["map_index"]` is not the index of a map.
        """
        super().reset(seed=seed)
        index = (options or {}).get("map_index", self._next_map if seed is None else seed % len(self.maps))
        if not isinstance(index, (int, np.integer)) or not 0 <= index < len(self.maps):
            raise InvalidValueError("map_index", f"0 to {len(self.maps) - 1}", index)
        self._next_map = (index + 1) % len(self.maps)
        self.map_index, map_config = int(index), self.maps[index]
        self._environment = environment_state(map_config).astype(np.float32)
        self._given = HeldAgent(np.zeros(2)), HeldAgent(np.zeros(2))
        agents, seed = self._given, 0
        if self.partner:
            agents, seed = (self._given[0], ScriptedAgent.of_pair(self.partner)), int(self.np_random.integers(2**31))
        self._rollout = Rollout(get_task(), [map_config], agents, seeds=[seed], settings=self.physics, beyond_end=True)
        self.world: Any = self._rollout.worlds[0]
        self._action = np.zeros(4)
        self._image = _scene_image(map_config, self._image_size) if self._image_size else None
        return self._observation(), self._info("", False, 0.0)

    def step(self, action: np.ndarray) -> tuple[dict, float, bool, bool, dict]:
        """Holds an action, `(4,)` or with a partner `(2,)`, for a frame.

        Raises:
            ShapeError: an action of another shape.
        """
        given = np.asarray(action, dtype=float)
        if given.shape != self._action_shape:
            raise ShapeError("action", self._action_shape, given.shape)
        given = np.clip(given, -1.0, 1.0)
        for agent, half in zip(self._given, (given[:2], given[2:]), strict=True):
            agent.action = half
        self._rollout.observers.clear()
        trace = Trace(self._rollout)
        for _ in range(self._stride):
            self._rollout.step()
            if self._rollout.outcomes[0].done:
                break
        (outcome,) = self._rollout.outcomes
        # The past human action is that of the frame: of several held steps their mean, as in a data set.
        self._action = np.mean(trace.actions(0), axis=0)
        forces = interaction_force(trace.states(0)[1:, 2], trace.actions(0))
        truncated = outcome.reason == "timeout"
        info = self._info(outcome.reason, outcome.success, float(np.abs(forces).mean()))
        return self._observation(), self.world.reward(), outcome.done and not truncated, truncated, info

    def render(self) -> np.ndarray | None:
        """`(300, 600, 3)` uint8 picture of the world at half size, or None without a render mode."""
        if not self.render_mode:
            return None
        # Here, because training without videos needs no pygame.
        from copolicy.collect.sdl import pygame
        from copolicy.tasks.table.artist.table_view import TableView

        surface = pygame.Surface((WINDOW[0] // 2, WINDOW[1] // 2), depth=24)
        TableView(self.world.map_config).draw(surface, surface.get_rect(), self.world.pose, self._action.tolist())
        return np.frombuffer(pygame.image.tobytes(surface, "RGB"), np.uint8).reshape(*surface.get_size()[::-1], 3)

    def _observation(self) -> dict[str, Any]:
        state = self.world.observation
        values = state.astype(np.float32), self._environment.copy(), self._action[2:].astype(np.float32)
        observation: dict[str, Any] = dict(zip(OBSERVATION_KEYS, values, strict=True))
        if self._image is not None:
            x, y = state[:2].tolist()
            observation["pixels"] = {"scene": self._image.draw((x, y, float(theta_of(state))))}
        return observation

    def _info(self, reason: str, success: bool, force: float) -> dict[str, Any]:
        return {
            "is_success": success,
            "termination_reason": reason,
            "interaction_force": force,  # mean magnitude over the frame, in units of a player's full force
            "map_index": self.map_index,
            "action": self._action.copy(),  # (4,) what was executed, the partner's half included
        }


def _check_pair(pair_id: str) -> None:
    pairs = simulated_players(get_task()).pairs
    if pair_id not in pairs:
        raise UnknownNameError("simulated pair", pair_id, pairs)


def _scene_image(map_config: MapConfig, size: tuple[int, int]):
    from copolicy.tasks.table.artist.scene_image import SceneImage

    return SceneImage(map_config, size)


def _box(column: str) -> gymnasium.spaces.Box:
    """Twice the range of the task's bounds, since a table may slip a little beyond them in its last step."""
    low, high = BOUNDS[column]
    margin = (high - low) / 2
    return gymnasium.spaces.Box((low - margin).astype(np.float32), (high + margin).astype(np.float32))
