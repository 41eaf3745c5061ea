"""One table of a study: the world, the partner at the human seat, and what a robot may know of both."""

import zlib

import numpy as np

from copolicy.dataset.clock import frame_actions
from copolicy.dataset.task import Outcome as End
from copolicy.tasks.table.agents.partners import simulated_partner
from copolicy.tasks.table.features import environment_state
from copolicy.tasks.table.interaction import interaction_force
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.world import TableWorld

from .outcome import STILL_SPEED, STILL_SPIN, PartnerOutcome


class PartnerTable:
    """A world with a partner, advanced one step of 1/30 s at a time.

    Attributes:
        map_config: the map, known to both.
        seed: of this table's partner; also there for robots that draw random numbers of their own.
        map_vector: `(11,)` observation of the map.
        states: last observations at the frames, newest last; the newest is the present one when a frame begins.
        human: what the partner did in the frame before each of them.
        plans: how often a robot planned.
    """

    def __init__(
        self, map_index: int, config: MapConfig, partner: str, repeat: int, physics: Physics, seed: int, frames: int
    ):
        self.map_config = config
        self.map_vector = environment_state(config)
        # Neither the robot nor the order of tables is in it: every robot meets the same partner on the same start.
        entropy = [seed, zlib.crc32(config.digest.encode()), repeat]
        self.seed = int(np.random.SeedSequence(entropy).generate_state(1)[0])
        self.plans = 0
        self._place = (map_index, repeat)
        self._kind = partner
        self._partner = simulated_partner(config, partner, self.seed)
        self._world = TableWorld(config, physics)
        # Before the start there is nothing: the first observation is repeated, as it is padded in training.
        self.states = [self._world.observation] * frames
        self.human = [np.zeros(2)] * frames
        self._path = [self._world.pose[:2]]
        self._actions: list[np.ndarray] = []
        self._interaction: list[float] = []
        self._still: list[bool] = []
        self._end: End | None = None

    @property
    def running(self) -> bool:
        """The episode has not ended."""
        return self._end is None

    @property
    def observation(self) -> np.ndarray:
        """`(7,)` present state."""
        return self._world.observation

    def step(self, robot_force: np.ndarray) -> None:
        """Both act on the present state: the robot with a force `(2,)`, the partner as it likes."""
        action = np.clip(np.concatenate((robot_force, self._partner.act(self.observation))), -1.0, 1.0)
        end = self._world.step(action)
        vx, vy, omega = self._world.velocity
        self._actions.append(action)
        self._path.append(self._world.pose[:2])
        self._interaction.append(float(interaction_force(self._world.pose[2], action)))
        self._still.append(vx * vx + vy * vy < STILL_SPEED**2 and abs(omega) < STILL_SPIN)
        if end.done:
            self._end = end

    def end_frame(self, stride: int, fps: int) -> None:
        """Takes the observation at the end of a frame of `stride` steps into the history."""
        frame = frame_actions(np.array(self._actions[-stride:]), fps)[0]
        self.states = [*self.states[1:], self.observation]
        self.human = [*self.human[1:], frame[2:]]

    def outcome(self) -> PartnerOutcome:
        """How the episode went, once it has ended."""
        assert self._end is not None
        return PartnerOutcome(
            self._place[0],
            self.map_config,
            self._place[1],
            self._end.success,
            self._end.reason,
            self.plans,
            np.array(self._path),
            np.array(self._interaction),
            self._kind,
            np.array(self._actions),
            np.array(self._still),
            self._partner.intention.changes,
        )
