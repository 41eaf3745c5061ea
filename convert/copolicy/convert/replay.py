"""Whether the recorded actions, played again, give the recorded path."""

import numpy as np

from copolicy.dataset.episode import Episode
from copolicy.dataset.features import theta_of
from copolicy.dataset.task import RECORD_HZ
from copolicy.tasks.table.physics import Physics

from .dynamics import integrate


def replay_drift(episode: Episode, physics: Physics) -> float:
    """Largest distance in px between the recorded path and the one re-simulated from the first state.

    NaN where not every 30 Hz action was stored.
    """
    if episode.fps != RECORD_HZ or not len(episode.actions):
        return float("nan")
    x, y, _, _, vx, vy, omega = episode.states[0].tolist()
    replayed = integrate((x, y, float(theta_of(episode.states[0]))), (vx, vy, omega), episode.actions, physics)
    return float(np.linalg.norm(replayed[:, :2] - episode.path, axis=1).max())
