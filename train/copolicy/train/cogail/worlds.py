"""Many worlds of a task that restart by themselves, each with a history of states and a code."""

from collections import Counter
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from copolicy.dataset.arrays import Array
from copolicy.dataset.clock import stride
from copolicy.dataset.task import World
from copolicy.dataset.task_spec import TIMEOUT
from lerobot_policy_copolicy.cogail.codes import GRID, draw_codes
from lerobot_policy_copolicy.cogail.inputs import next_history

from .demonstrations import Demonstrations


class Step(NamedTuple):
    """What a frame of all W worlds ended with.

    Attributes:
        ended: `(W,)` the episode ended in this frame, and the world was restarted.
        truncated: `(W,)` it ended at the step limit.
        succeeded: `(W,)` it ended in success.
        final_histories, final_scenarios, final_codes: of the truncated worlds, at their end.
    """

    ended: Array
    truncated: Array
    succeeded: Array
    final_histories: Tensor
    final_scenarios: Tensor
    final_codes: Tensor


class RestartingWorlds:
    """W worlds in the scenarios of the demonstrations.

    An episode starts at a demonstrated frame with its history, see `CoGailConfig.start_frames`, and gets a code: the
    points of the grid in turn, with noise. An action is held for the steps of one frame of the data set.

    Attributes:
        histories: `(W, T, n)` states in the task's units.
        scenarios: `(W, k)`.
        codes: `(W, 2)`.
        reasons: number of episodes by termination reason since the last `take_episodes`.
    """

    def __init__(self, demonstrations: Demonstrations, count: int, settings: Any, fps: float, start_frames: str):
        """
        Args:
            count: W.
            settings: of the world.
            fps: frames a second of the data.
            start_frames: "first" or "any".
        """
        self._demonstrations, self._settings, self._any = demonstrations, settings, start_frames == "any"
        self.task = demonstrations.task
        self._stride = stride(int(fps), self.task.spec.record_hz)
        self._next_code = 0
        self._rows = torch.zeros(count, dtype=torch.long)  # demonstrated frames at which the worlds started
        self._worlds: list[World] = []
        windows = demonstrations.windows(self._draw_rows(count))
        self.histories, self.scenarios = torch.zeros_like(windows.states), torch.zeros_like(windows.scenarios)
        self.codes = torch.zeros((count, GRID.shape[1]))
        self.reasons: Counter[str] = Counter()
        self._lengths: list[int] = []
        self._frames = np.zeros(count, int)
        for index in range(count):
            self._worlds.append(self._restarted(index))

    def step(self, actions: Array) -> Step:
        """Executes joint actions `(W, 2 m)` in the task's units, within their bounds, for one frame."""
        ended, truncated, succeeded = np.zeros((3, len(actions)), bool)
        states = np.empty((len(actions), self.histories.shape[2]), np.float32)
        for index, (world, action) in enumerate(zip(self._worlds, actions, strict=True)):
            for _ in range(self._stride):
                outcome = world.step(action)
                if outcome.done:
                    ended[index], succeeded[index] = True, outcome.success
                    truncated[index] = outcome.reason == TIMEOUT
                    self.reasons[outcome.reason] += 1
                    break
            states[index] = world.observation
        self._frames += 1
        self.histories = next_history(self.histories, torch.from_numpy(states))
        final = torch.from_numpy(truncated)
        step = Step(ended, truncated, succeeded, self.histories[final], self.scenarios[final], self.codes[final])
        for index in np.flatnonzero(ended).tolist():
            self._lengths.append(int(self._frames[index]))
            self._worlds[index] = self._restarted(index)
        return step

    def take_episodes(self) -> tuple[Counter[str], float]:
        """Ended episodes by reason, and their mean length in frames, since the last call."""
        taken = self.reasons, float(np.mean(self._lengths)) if self._lengths else 0.0
        self.reasons, self._lengths = Counter(), []
        return taken

    def state(self) -> dict[str, Any]:
        """Everything that a resumed training needs to continue exactly."""
        return {
            "recorded": torch.tensor([world.recorded for world in self._worlds], dtype=torch.float64),
            "steps": torch.tensor([world.step_count for world in self._worlds]),
            "frames": torch.from_numpy(self._frames.copy()),
            "rows": self._rows.clone(),
            "histories": self.histories.clone(),
            "scenarios": self.scenarios.clone(),
            "codes": self.codes.clone(),
            "next_code": self._next_code,
        }

    def load(self, state: dict[str, Any]) -> None:
        """Restores `state`."""
        self._rows, self._next_code = state["rows"].clone(), int(state["next_code"])
        self.histories, self.scenarios, self.codes = (
            state[name].clone() for name in ("histories", "scenarios", "codes")
        )
        self._frames = state["frames"].numpy().copy()
        for index, (recorded, steps) in enumerate(
            zip(state["recorded"].tolist(), state["steps"].tolist(), strict=True)
        ):
            self._worlds[index] = world = self._made(index)
            world.restore(recorded)
            world.step_count = steps

    def _draw_rows(self, count: int) -> Tensor:
        if self._any:
            return torch.randint(len(self._demonstrations), (count,))
        starts = self._demonstrations.starts
        return starts[torch.randint(len(starts), (count,))]

    def _restarted(self, index: int) -> World:
        """A world at a new start; sets history, scenario and code of its place."""
        row = self._draw_rows(1)
        windows = self._demonstrations.windows(row)
        self._rows[index] = row
        self.histories[index], self.scenarios[index] = windows.states[0], windows.scenarios[0]
        self.codes[index] = draw_codes(torch.tensor([self._next_code]))[0]
        self._next_code = (self._next_code + 1) % len(GRID)
        self._frames[index] = 0
        world = self._made(index)
        world.restore(self.task.recorded_of(windows.states[0, -1:].double().numpy())[0].tolist())
        return world

    def _made(self, index: int) -> World:
        columns = self._demonstrations.scenario_columns(int(self._rows[index]))
        scenario = self.task.scenario_of_vector(self.scenarios[index].double().numpy(), columns)
        return self.task.make_world(scenario, self._settings)
