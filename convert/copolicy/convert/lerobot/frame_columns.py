"""Converts an episode to the columns of a LeRobot data set."""

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.clock import Downsampling, frame_actions, frame_states, previous_actions, stride
from copolicy.dataset.episode import Episode
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.dataset.task import get_task


def frame_columns(episode: Episode, fps: int, downsampling: Downsampling = "mean") -> dict[str, Array]:
    """Returns the columns of an episode (`features_of` its task) at `fps`, `(T', n)` float32 or `(T',)`.

    `next.reward` is the reward of the state after the frame's recorded steps; `next.done` marks the last frame,
    `next.success` the last frame of a successful episode.

    Raises:
        InvalidValueError: no steps, a value that is not finite, an `fps` that does not divide the recording rate, or
            an `fps` other than that of an episode stored at a lower rate.
    """
    task = get_task(episode.task)
    states, actions = _at_rate(episode, task.spec.record_hz, fps, downsampling)
    next_states = np.vstack((states[1:], episode.final_state))
    frames = len(states)
    last = np.arange(frames) == frames - 1
    columns = {
        STATE: states.astype(np.float32),
        ENVIRONMENT_STATE: np.tile(task.scenario_vector(episode.scenario).astype(np.float32), (frames, 1)),
        HUMAN_ACTION: np.split(previous_actions(actions), 2, axis=1)[1].astype(np.float32),
        ACTION: actions.astype(np.float32),
        "next.reward": task.rewards(episode.scenario, next_states).astype(np.float32),
        "next.done": last,
        "next.success": last & episode.meta.success,
    }
    for name, column in columns.items():
        if not np.isfinite(column).all():
            raise InvalidValueError(f"{name} of episode {episode.meta.episode_uuid}", "finite values", "nan or inf")
    return columns


def _at_rate(episode: Episode, record_hz: int, fps: int, downsampling: Downsampling) -> tuple[Array, Array]:
    if not len(episode.actions):
        raise InvalidValueError(f"steps of episode {episode.meta.episode_uuid}", "at least one", 0)
    if episode.fps == record_hz:
        actions = frame_actions(episode.actions, fps, downsampling, record_hz)
        return frame_states(episode.states, fps, record_hz), actions
    stride(fps, record_hz)
    if fps != episode.fps:
        rate = f"{episode.fps}, the only rate at which episode {episode.meta.episode_uuid} was stored"
        raise InvalidValueError("fps", rate, fps)
    return episode.states, episode.actions
