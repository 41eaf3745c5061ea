"""The gymnasium environment of any task for two players."""

from dataclasses import replace
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec

from copolicy.collect.agents import ConstantAgent, ScriptedAgent
from copolicy.collect.rollout import Rollout, Trace
from copolicy.dataset.arrays import Array
from copolicy.dataset.clock import frames, stride
from copolicy.dataset.exceptions import InvalidValueError, ShapeError
from copolicy.dataset.features import OBSERVATION_KEYS, bounds_of
from copolicy.dataset.task import SceneView
from copolicy.dataset.task_spec import TIMEOUT

from .configuration import PairTaskEnvConfig

_WIDTH = 600  # width of the image of `render`, px


class PairEnv(gymnasium.Env):
    """Environment of a two-player task, given by name.

    ## Action space
    A `Box` of both players' actions, robot first, in the units and bounds of the task, held for record_hz / fps steps
    of the world. With a simulated `partner` it is the robot's half; the partner acts for the human at every step.

    ## Observation space
    A `Dict` of float32 in the units of the task, with LeRobot's keys: `agent_pos` (column `observation.state`),
    `environment_state` (the vector of the scenario), `human_action` (the human's action of the previous frame, zero at
    the first), and with `pixels=True` `pixels`: {"scene": (height, width, 3) uint8}.

    ## Reward
    The task's reward of the state at the end of the frame.

    ## Success and end
    `info["is_success"]` is set at every step; `info["termination_reason"]` is one of the task's reasons. An episode may
    end within a frame. It is truncated after `step_limit` steps of the world with the reason `timeout`, which is in
    frame `ceil(step_limit * fps / record_hz)`. A `max_episode_steps` of `gymnasium.make` truncates without a reason.

    ## Starting state
    The start of a scenario: `s % scenarios` for `reset(seed=s)`, i for `reset(options={"map_index": i})`, and the next
    scenario for `reset()`.

    Args:
        task: name of the task.
        render_mode: "rgb_array" or None.
        settings: settings of `PairTaskEnvConfig`, which raises the errors.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 (as gymnasium declares it)
    config_type: ClassVar[type[PairTaskEnvConfig]] = PairTaskEnvConfig

    def __init__(self, task: str | None = None, render_mode: str | None = "rgb_array", **settings: Any):
        if task is not None:
            settings["task"] = task
        config = self.config_type(**settings)
        self.metadata = {**type(self).metadata, "render_fps": config.fps}
        self.render_mode = render_mode
        self.pair_task = config.pair_task
        spec = self.pair_task.spec
        self.task, self.task_description = spec.name, spec.sentence
        self.scenarios, self.world_settings, self.partner = config.scenarios, config.world_settings, config.partner
        self._spec: EnvSpec | None = None
        self._stride = stride(config.fps, spec.record_hz)
        self._next_index = 0
        # LeRobot reads this attribute.
        self._max_episode_steps = frames(self.world_settings.step_limit, config.fps, spec.record_hz)
        self._size = len(spec.action)
        self._bounds = spec.joint_action.bounds[:, : self._size if self.partner else None]
        low, high = self._bounds.astype(np.float32)
        self.action_space = gymnasium.spaces.Box(low, high, dtype=np.float32)
        bounds = bounds_of(spec)
        spaces: dict[str, gymnasium.Space] = {key: _box(bounds[column]) for key, column in OBSERVATION_KEYS.items()}
        self._image_size = (config.observation_width, config.observation_height) if config.pixels else None
        if self._image_size:
            image = gymnasium.spaces.Box(0, 255, (*self._image_size[::-1], 3), np.uint8)
            spaces["pixels"] = gymnasium.spaces.Dict({"scene": image})
        self.observation_space = gymnasium.spaces.Dict(spaces)

    @property
    def spec(self) -> EnvSpec | None:
        """The registered specification, with the frame limit of this environment as `max_episode_steps`."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:  # pyright: ignore[reportIncompatibleVariableOverride]
        if spec is not None and spec.max_episode_steps is None:
            spec = replace(spec, max_episode_steps=self._max_episode_steps)
        self._spec = spec

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[dict, dict]:
        """Starts an episode in a scenario.

        Raises:
            InvalidValueError: `options["map_index"]` is no index of a scenario.
        """
        super().reset(seed=seed)
        index = (options or {}).get("map_index", self._next_index if seed is None else seed % len(self.scenarios))
        if not isinstance(index, (int, np.integer)) or not 0 <= index < len(self.scenarios):
            raise InvalidValueError("map_index", f"0 to {len(self.scenarios) - 1}", index)
        self._next_index = (index + 1) % len(self.scenarios)
        self.map_index, scenario = int(index), self.scenarios[index]
        self._view: SceneView | None = None
        self._environment = self.pair_task.scenario_vector(scenario).astype(np.float32)
        self._seat_agents = ConstantAgent(np.zeros(self._size)), ConstantAgent(np.zeros(self._size))
        agents, seed = self._seat_agents, 0
        if self.partner:
            partner = ScriptedAgent.from_pair(self.partner, self.pair_task)
            agents, seed = (self._seat_agents[0], partner), int(self.np_random.integers(2**31))
        self._rollout = Rollout(
            self.pair_task, [scenario], agents, seeds=[seed], settings=self.world_settings, beyond_end=True
        )
        self.world: Any = self._rollout.worlds[0]
        self._action = np.zeros(2 * self._size)
        return self._observation(), self._info("", False, self._interaction(None))

    def step(self, action: Array) -> tuple[dict, float, bool, bool, dict]:
        """Holds a joint action, or the robot's half with a partner, for one frame.

        Raises:
            ShapeError: `action` has another shape than the action space.
        """
        action = np.asarray(action, dtype=float)
        if action.shape != self.action_space.shape:
            raise ShapeError("action", self._bounds.shape[1:], action.shape)
        action = np.clip(action, *self._bounds)
        for agent, half in zip(self._seat_agents, (action[: self._size], action[self._size :]), strict=True):
            agent.action = half
        self._rollout.observers.clear()
        trace = Trace(self._rollout)
        for _ in range(self._stride):
            self._rollout.step()
            if self._rollout.outcomes[0].done:
                break
        (outcome,) = self._rollout.outcomes
        # As in a data set, the past human action of a frame is the mean over its steps.
        self._action = np.mean(trace.actions(0), axis=0)
        truncated = outcome.reason == TIMEOUT
        info = self._info(outcome.reason, outcome.success, self._interaction(trace))
        return self._observation(), self.world.reward(), outcome.done and not truncated, truncated, info

    def render(self) -> Array | None:
        """Draws the world, `(height, 600, 3)` uint8 (height 300 for the table); None without a render mode.

        Raises:
            CopolicyError: the task has no outline.
        """
        if not self.render_mode:
            return None
        # Imported here because training without videos needs no pygame.
        from copolicy.collect.screen.canvas import new_surface
        from copolicy.collect.screen.outline_view import scene_view
        from copolicy.collect.sdl import pygame

        outline = self.pair_task.required_outline
        size = _WIDTH, round(_WIDTH * outline.size[1] / outline.size[0])
        surface = new_surface(size)
        (pose,), (forces,) = outline.poses(self.world.observation[None]), outline.forces(self._action[None])
        if self._view is None:  # it caches the parts that do not move
            self._view = scene_view(self.pair_task, self.scenarios[self.map_index])
        self._view.draw(surface, surface.get_rect(), tuple(pose.tolist()), forces.tolist())
        return np.frombuffer(pygame.image.tobytes(surface, "RGB"), np.uint8).reshape(*size[::-1], 3)

    def _observation(self) -> dict[str, Any]:
        state = self.world.observation
        human = self._action[self._size :].astype(np.float32)
        values = state.astype(np.float32), self._environment.copy(), human
        observation: dict[str, Any] = dict(zip(OBSERVATION_KEYS, values, strict=True))
        if self._image_size is not None:
            images = self.pair_task.images(self.scenarios[self.map_index], state[None], self._image_size)
            observation["pixels"] = {"scene": next(iter(images or ()))}
        return observation

    def _interaction(self, trace: Trace | None) -> dict[str, float]:
        """The mean magnitude over the frame, zero before the first; empty if the task does not measure it."""
        actions = np.zeros((1, 2 * self._size)) if trace is None else trace.actions(0)
        recorded = np.array([self.world.recorded]) if trace is None else trace.states(0)[1:]
        measured = self.pair_task.interaction_recorded(recorded, actions)
        return {} if measured is None else {"interaction_force": float(np.abs(measured).mean())}

    def _info(self, reason: str, success: bool, interaction: dict[str, float]) -> dict[str, Any]:
        return {
            "is_success": success,
            "termination_reason": reason,
            **interaction,
            "map_index": self.map_index,
            "action": self._action.copy(),  # (2 m,) executed joint action, including the partner's half
        }


def _box(bounds: Array) -> gymnasium.spaces.Box:
    """Twice the range of the task's bounds, since a world may slightly exceed them in its last step."""
    low, high = bounds
    margin = (high - low) / 2
    return gymnasium.spaces.Box((low - margin).astype(np.float32), (high + margin).astype(np.float32))
