"""Policies without torch that a process of policies loads."""

import os
import time

import numpy as np

from copolicy.dataset.exceptions import FileFormatError


class Constant:
    """Pushes with a constant force; the one named `busy` computes for a while first, `dies` ends its process."""

    task = "table"
    n_obs_steps = 2
    n_action_steps = 1
    fps = 10
    keeps_history = False

    def __init__(self, name: str, force: float):
        self.name = name
        self.force = force

    def reset(self, seed: int) -> None:
        self.force += seed

    def predict_action_chunk(self, observations: dict) -> np.ndarray:
        self.keeps_history = self.name == "keeper"
        if self.name == "dies":
            os._exit(3)
        if self.name == "busy":
            end = time.monotonic() + 0.3
            while time.monotonic() < end:
                sum(range(10_000))
        return np.full((1, 4, 4), self.force) * [1, 0, -1, 0]


def load() -> dict[str, Constant]:
    return {name: Constant(name, force) for name, force in (("calm", 0.1), ("keeper", 0.2), ("dies", 0), ("busy", 0.3))}


def load_none() -> dict[str, Constant]:
    raise FileFormatError("robot", "a checkpoint", "none")


def process_id() -> int:
    return os.getpid()
