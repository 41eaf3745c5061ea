"""The gymnasium environment of a second task, and through LeRobot's configuration."""

from typing import Any

import draccus
import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from lerobot.envs import EnvConfig, make_env
from lerobot.envs.utils import env_to_policy_features

from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from lerobot_policy_copolicy.env import PairTaskEnvConfig
from lerobot_policy_copolicy.env.configuration import PAIR_GYM_ID
from lerobot_policy_copolicy.env.pair_env import PairEnv

pytestmark = pytest.mark.filterwarnings("ignore:pkg_resources is deprecated")


@pytest.mark.parametrize(("partner", "size"), [("", 2), ("lazy", 1)])
def test_passes_gymnasiums_checks(peg, partner, size):
    env: Any = gymnasium.make(PAIR_GYM_ID, task="peg", partner=partner)
    check_env(env.unwrapped)
    assert env.action_space == gymnasium.spaces.Box(-1.0, 1.0, (size,), np.float32)
    assert env.spec.max_episode_steps == 100  # 200 steps of 1/20 s, 10 frames a second
    assert env.unwrapped.task_description == peg.spec.sentence


def test_it_is_the_world_of_the_task(peg):
    env = PairEnv("peg", fps=5, map_set="left", settings={"push": 2.0})
    observation, info = env.reset(seed=4)  # the second of three lines
    assert info["map_index"] == 1
    np.testing.assert_allclose(observation["environment_state"], (0.5, -0.4))
    world = peg.make_world(env.scenarios[1], peg.settings_type(push=2.0))
    action = np.array([-0.5, 0.25])
    for _ in range(4):
        world.step(action)
    observation, reward, terminated, truncated, info = env.step(action)
    np.testing.assert_allclose(observation["agent_pos"], world.observation, rtol=1e-6)
    assert observation["human_action"].tolist() == [0.25]
    assert (reward, terminated, truncated) == (world.reward(), False, False)
    assert "interaction_force" not in info  # which the task does not measure
    for _ in range(60):
        *_, terminated, truncated, info = env.step(np.array([1.0, 1.0]))
        if terminated:
            break
    assert info["termination_reason"] == "off_the_line"


def test_its_picture_is_drawn_from_the_outline(peg):
    env = PairEnv("peg")
    env.reset(seed=0)
    picture = env.render()
    assert picture is not None
    assert picture.shape == (120, 600, 3)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 3


@pytest.mark.parametrize(
    ("settings", "error", "message"),
    [
        ({"fps": 8}, InvalidValueError, "fps: expected a divisor of 20"),
        ({"map_set": "training"}, UnknownNameError, "unknown map set 'training'; available: left, right"),
        ({"orientations": True}, InvalidValueError, "--orientations: expected no such flag"),
        ({"partner": "S01"}, UnknownNameError, "unknown simulated pair 'S01'; available: even, lazy"),
        ({"pixels": True}, InvalidValueError, "pixels: expected false .left out: the task 'peg' has no images"),
        ({"step_limit": 0}, InvalidValueError, "step_limit: expected at least 1, found 0"),
        ({"settings": {"mass": 1.0}}, InvalidValueError, "settings: expected some of step_limit, damping, push"),
    ],
)
def test_what_it_lacks_is_refused(peg, settings, error, message):
    for make in (PairEnv, PairTaskEnvConfig):
        with pytest.raises(error, match=message):
            make(task="peg", **settings)


def test_lerobots_configuration_names_the_task(peg):
    config = draccus.decode(EnvConfig, {"type": "pair_task", "task": "peg", "partner": "even", "settings": {"push": 2}})
    assert isinstance(config, PairTaskEnvConfig)
    features = {key: tuple(feature.shape) for key, feature in env_to_policy_features(config).items()}
    assert features == {STATE: (2,), ENVIRONMENT_STATE: (2,), HUMAN_ACTION: (1,), ACTION: (2,)}
    env: Any = make_env(config, n_envs=2)["pair_task"][0]
    try:
        observation, _ = env.reset(seed=[0, 1])
        assert observation["environment_state"].shape == (2, 2)
        assert env.single_action_space.shape == (1,)
    finally:
        env.close()
    _, actions = config.get_env_processors()
    assert actions.steps[0].action(np.zeros((3, 2))).shape == (3, 1)


def test_no_task_is_named():
    with pytest.raises(InvalidValueError, match=r"^--env\.task: expected a task, of table, found 'none'"):
        PairTaskEnvConfig()
