import numpy as np
import pytest

from copolicy.convert.lerobot.frame_columns import frame_columns
from copolicy.dataset.episode import Episode, EpisodeMeta
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.tasks.table.features import FEATURES, environment_state
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.world import TableWorld

CONFIG = MAP_SETS["training"][5]


def play(steps: int, fps: int = 30, **columns) -> Episode:
    """Random forces from the start of a map."""
    world = TableWorld(CONFIG)
    actions = np.random.default_rng(0).uniform(-1, 1, (steps, 4))
    states = [world.observation]
    for action in actions:
        world.step(action)
        states.append(world.observation)
    return Episode(
        np.array(states[:-1]).reshape(-1, 7), actions, states[-1], EpisodeMeta("one", **columns), CONFIG, fps
    )


@pytest.mark.parametrize(("fps", "hold"), [(30, "mean"), (10, "mean"), (10, "first"), (5, "mean")])
def test_columns_follow_the_one_clock(fps, hold):
    episode = play(50, success=True)
    columns = frame_columns(episode, fps, hold)
    step = 30 // fps
    starts = range(0, 50, step)
    assert list(columns) == list(FEATURES)
    for name, feature in FEATURES.items():
        shape = () if feature["shape"] == (1,) else feature["shape"]
        assert columns[name].shape == (len(starts), *shape)
        assert columns[name].dtype == feature["dtype"]
    world = TableWorld(CONFIG)
    for frame, start in enumerate(starts):
        held = episode.actions[start : start + step]
        action = held.mean(axis=0) if hold == "mean" else held[0]
        assert columns["observation.state"][frame] == pytest.approx(episode.states[start], rel=1e-6)
        assert columns["action"][frame] == pytest.approx(action, abs=1e-6)
        path = episode.path
        assert path is not None
        x, y = path[min(start + step, 50)]
        world.reset((x, y, 0.0))
        assert columns["next.reward"][frame] == pytest.approx(world.reward(), abs=1e-6)
    assert (columns["observation.human_action"][0] == 0).all()
    assert np.array_equal(columns["observation.human_action"][1:], columns["action"][:-1, 2:])
    assert (columns["observation.environment_state"] == environment_state(CONFIG).astype(np.float32)).all()
    assert columns["next.done"].tolist() == [False] * (len(starts) - 1) + [True]
    assert columns["next.success"].tolist() == columns["next.done"].tolist()


def test_a_failure_has_an_end_but_no_success():
    columns = frame_columns(play(7), 10)
    assert columns["next.done"].tolist() == [False, False, True]
    assert not columns["next.success"].any()


def test_an_episode_stored_at_10_hz_is_taken_as_it_is():
    episode = play(8, fps=10)
    columns = frame_columns(episode, 10, "first")
    assert np.array_equal(columns["action"], episode.actions.astype(np.float32))
    with pytest.raises(InvalidValueError) as error:
        frame_columns(episode, 5)
    assert str(error.value) == "fps: expected 10, the only rate at which episode one was stored, found 5"


def test_what_cannot_be_converted():
    with pytest.raises(InvalidValueError, match="steps of episode one: expected at least one, found 0"):
        frame_columns(play(0), 10)
    with pytest.raises(InvalidValueError, match=r"fps: expected a divisor of 30"):
        frame_columns(play(4), 7)
    episode = play(4)
    episode.actions[2, 1] = np.nan
    with pytest.raises(InvalidValueError, match="of episode one: expected finite values, found 'nan or inf'"):
        frame_columns(episode, 10)
