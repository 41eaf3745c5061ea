"""The gymnasium environment: its contract, its clock, its maps and its simulated partner."""

import math
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env
from lerobot.configs import FeatureType
from lerobot.envs import make_env
from lerobot.envs.factory import make_env_pre_post_processors
from lerobot.envs.utils import env_to_policy_features, preprocess_observation

from copolicy.dataset.exceptions import InvalidValueError, ShapeError, UnknownNameError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, GYM_ID, HUMAN_ACTION, SCENE_IMAGE, STATE
from copolicy.tasks.table import TableTask
from copolicy.tasks.table.features import FEATURES, environment_state
from copolicy.tasks.table.interaction import interaction_force
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.world import TableWorld
from lerobot_policy_copolicy import CopolicyConfig
from lerobot_policy_copolicy.env.configuration_table_carrying import TableCarryingEnvConfig
from lerobot_policy_copolicy.env.table_carrying import TableCarryingEnv

# pygame imports setuptools' old API where that is installed.
pytestmark = pytest.mark.filterwarnings("ignore:pkg_resources is deprecated")

PUSH = np.array([1.0, 0.2, 1.0, 0.2], np.float32)


def episode(env: gymnasium.Env, action=PUSH, frames: int = 400) -> list[tuple]:
    steps = []
    for _ in range(frames):
        steps.append(env.step(action))
        if steps[-1][2] or steps[-1][3]:
            break
    return steps


@pytest.mark.parametrize(("partner", "size"), [("", 4), ("S01", 2)])
@pytest.mark.parametrize("pixels", [False, True])
def test_passes_gymnasiums_checks(partner, size, pixels):
    env = gymnasium.make(GYM_ID, partner=partner, pixels=pixels, observation_width=64, observation_height=64)
    check_env(env.unwrapped)
    assert env.action_space == gymnasium.spaces.Box(-1.0, 1.0, (size,), np.float32)


@pytest.mark.parametrize(
    ("settings", "frames"),
    [({}, 334), ({"fps": 30}, 1000), ({"fps": 5, "step_limit": 100}, 17), ({"fps": 30, "step_limit": 400}, 400)],
)
def test_is_truncated_where_rate_and_step_limit_say_and_says_why(settings, frames):
    env = gymnasium.make(GYM_ID, **settings)
    env.reset(seed=0)
    steps = episode(env, np.zeros(4, np.float32), frames=frames + 1)
    assert len(steps) == frames
    assert steps[-1][2:4] == (False, True)
    assert steps[-1][4]["termination_reason"] == "timeout"
    assert env.spec is not None
    assert env.spec.max_episode_steps == frames
    again = gymnasium.make(env.spec)  # as Minari and others do
    again.reset(seed=0)
    assert len(episode(again, np.zeros(4, np.float32), frames=frames + 1)) == frames


@pytest.mark.parametrize(("fps", "held"), [(30, 1), (10, 3), (5, 6)])
def test_an_action_is_held_for_a_frame(fps, held):
    env = TableCarryingEnv(fps=fps)
    env.reset(options={"map_index": 7})
    world = TableWorld(MAP_SETS["training"][7])
    action = np.random.default_rng(0).uniform(-1, 1, 4).astype(np.float32)
    observation, reward, terminated, truncated, info = env.step(action)
    for _ in range(held):
        world.step(action)
    np.testing.assert_allclose(observation["agent_pos"], world.observation, rtol=1e-6)
    assert reward == world.reward()
    assert (terminated, truncated, info["is_success"]) == (False, False, False)


def test_observation_is_the_data_sets():
    env = TableCarryingEnv()
    observation, _ = env.reset(options={"map_index": 3})
    batch = preprocess_observation(observation)
    for key in (STATE, ENVIRONMENT_STATE, HUMAN_ACTION):
        assert tuple(batch[key].shape) == (1, *FEATURES[key]["shape"])
    np.testing.assert_allclose(observation["environment_state"], environment_state(MAP_SETS["training"][3]), rtol=1e-6)
    assert not observation["human_action"].any()
    observation, *_ = env.step(np.array([0.1, 0.2, 0.3, -2.0], np.float32))
    assert observation["human_action"].tolist() == pytest.approx([0.3, -1.0])  # of the frame before, as executed


def test_seeds_go_through_the_maps():
    env = TableCarryingEnv(map_set="unseen")
    indices = [env.reset(seed=1000 + i)[1]["map_index"] for i in range(84)]
    assert sorted(indices) == list(range(84))
    env.reset(seed=82)
    assert [env.reset()[1]["map_index"] for _ in range(3)] == [83, 0, 1]
    assert env.reset(seed=5, options={"map_index": 40})[1]["map_index"] == 40
    with pytest.raises(InvalidValueError, match=r"^map_index: expected 0 to 83, found 84$"):
        env.reset(options={"map_index": 84})


def test_orientations_quadruple_the_maps():
    env = TableCarryingEnv(map_set="holdout", orientations=True)
    angles = [env.reset(options={"map_index": i})[0]["environment_state"][2] for i in range(4)]
    assert len(env.scenarios) == 4 * 84
    assert angles == pytest.approx([0, math.pi / 2, math.pi, 3 * math.pi / 2])


def test_collision_terminates_within_a_frame():
    env = TableCarryingEnv(fps=1)
    env.reset(options={"map_index": 0})
    *_, (_, _, terminated, truncated, info) = episode(env, np.array([-1, 0, -1, 0], np.float32))
    assert terminated
    assert not truncated
    assert info["termination_reason"] == "collision_wall"
    assert not info["is_success"]
    assert env.world.step_count % 30 != 0


def test_reaching_the_goal_is_success():
    env = TableCarryingEnv()
    env.reset(options={"map_index": 0})
    env.world.reset((800.0, 180.0, math.pi))
    *_, (_, _, terminated, _, info) = episode(env, np.array([1, 0, 1, 0], np.float32))
    assert terminated
    assert info["is_success"]
    assert info["termination_reason"] == "goal"


def test_time_runs_out():
    env = TableCarryingEnv(step_limit=10)
    env.reset(seed=0)
    steps = episode(env, np.zeros(4, np.float32))
    assert len(steps) == 4  # 3 + 3 + 3 + 1 steps of the world
    assert steps[-1][2:4] == (False, True)
    assert steps[-1][4]["termination_reason"] == "timeout"


def test_angular_limit_reaches_the_dynamics():
    twist = np.array([0, 1, 0, -1], np.float32)
    spins = []
    for limit in (math.pi / 2, math.pi / 8):
        env = TableCarryingEnv(angular_acceleration_limit=limit)
        env.reset(seed=0)
        spins.append(abs(env.step(twist)[0]["agent_pos"][6]))
    assert spins[0] > 3 * spins[1]


def test_interaction_force_is_the_frames_mean_magnitude():
    env = TableCarryingEnv(fps=30)
    env.reset(seed=0)
    action = np.array([1, 0, -1, 0], np.float32)
    info = env.step(action)[4]
    assert info["interaction_force"] == pytest.approx(abs(interaction_force(env.world.pose[2], action)))


def test_partner_acts_for_the_human():
    env = TableCarryingEnv(partner="S01")
    robot = np.array([0.5, 0], np.float32)
    runs = []
    for _ in range(2):
        env.reset(seed=3)
        runs.append([env.step(robot) for _ in range(10)])
    for a, b in zip(*runs, strict=True):
        np.testing.assert_array_equal(a[0]["agent_pos"], b[0]["agent_pos"])
        np.testing.assert_array_equal(a[0]["human_action"], a[4]["action"][2:].astype(np.float32))
        np.testing.assert_array_equal(a[4]["action"][:2], robot)
    assert any(step[0]["human_action"].any() for step in runs[0])
    env.reset(seed=3 + len(env.scenarios))  # same map, another mood
    other = [env.step(robot) for _ in range(10)]
    assert not all(np.array_equal(a[0]["agent_pos"], b[0]["agent_pos"]) for a, b in zip(other, runs[0], strict=True))


def test_partner_and_passive_robot_get_somewhere():
    env = TableCarryingEnv(partner="S01")
    env.reset(options={"map_index": 0})
    start = env.world.pose[0]
    episode(env, np.zeros(2, np.float32), frames=60)
    assert env.world.pose[0] > start + 50


@pytest.mark.parametrize("size", [(600, 300), (96, 96)])
def test_observes_the_images_of_a_data_set(size):
    env = TableCarryingEnv(pixels=True, observation_width=size[0], observation_height=size[1])
    observation, _ = env.reset(options={"map_index": 20})
    states, images = [env.world.observation], [observation["pixels"]["scene"]]
    for _ in range(2):
        observation, *_ = env.step(PUSH)
        assert env.observation_space.contains(observation)
        states.append(env.world.observation)
        images.append(observation["pixels"]["scene"])
    expected = list(TableTask().images(env.scenarios[20], np.stack(states), size))
    np.testing.assert_array_equal(images, expected)
    batch = preprocess_observation(observation)
    assert tuple(batch[SCENE_IMAGE].shape) == (1, 3, size[1], size[0])
    assert set(batch) == {STATE, ENVIRONMENT_STATE, HUMAN_ACTION, SCENE_IMAGE}
    assert "pixels" not in TableCarryingEnv().reset(seed=0)[0]


def test_picture_shows_the_players():
    env = TableCarryingEnv()
    env.reset(seed=0)
    picture = env.render()
    assert picture is not None
    assert picture.shape == (300, 600, 3)
    assert picture.dtype == np.uint8
    # theta = 3.14: the robot's blue triangle on the left, the human's orange circle on the right.
    robot, human = picture[60, 120 - 37].astype(int), picture[60, 120 + 39].astype(int)
    assert robot[2] > robot[0] + 60
    assert human[0] > human[2] + 60
    assert TableCarryingEnv(render_mode=None).render() is None


@pytest.mark.parametrize(("partner", "size"), [("", 4), ("S01", 2)])
def test_lerobot_makes_vector_environments(partner, size):
    config = TableCarryingEnvConfig(fps=5, map_set="holdout", step_limit=100, partner=partner, pixels=True)
    env: Any = make_env(config, n_envs=2)["table_carrying"][0]
    try:
        observation, _ = env.reset(seed=[0, 1])
        batch = preprocess_observation(observation)
        assert tuple(batch[STATE].shape) == (2, 7)
        assert tuple(batch[SCENE_IMAGE].shape) == (2, 3, 300, 600)
        assert env.call("_max_episode_steps")[0] == 17
        assert env.metadata["render_fps"] == 5
        assert env.single_action_space.shape == (size,)
        *_, info = env.step(np.zeros((2, size), np.float32))
        assert info["is_success"].tolist() == [False, False]
    finally:
        env.close()


@pytest.mark.parametrize(("partner", "size"), [("", 4), ("S01", 2)])
def test_of_a_policys_action_a_partner_leaves_the_robots_half(partner, size):
    _, postprocessor = make_env_pre_post_processors(TableCarryingEnvConfig(partner=partner), CopolicyConfig())
    action = torch.arange(8.0).reshape(2, 4)
    assert postprocessor({ACTION: action})[ACTION].tolist() == action[:, :size].tolist()


def test_policy_features_are_the_data_sets():
    features = env_to_policy_features(TableCarryingEnvConfig())
    columns = {key: FEATURES[key]["shape"] for key in (STATE, ENVIRONMENT_STATE, HUMAN_ACTION, ACTION)}
    assert {key: tuple(feature.shape) for key, feature in features.items()} == columns
    features = env_to_policy_features(TableCarryingEnvConfig(pixels=True, observation_width=96, observation_height=64))
    assert {key: tuple(feature.shape) for key, feature in features.items()} == {**columns, SCENE_IMAGE: (3, 64, 96)}
    assert features[SCENE_IMAGE].type is FeatureType.VISUAL


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: TableCarryingEnvConfig(fps=7), InvalidValueError, "fps: expected a divisor of 30"),
        (lambda: TableCarryingEnvConfig(map_set="v2"), UnknownNameError, "unknown map set 'v2'; available: holdout"),
        (lambda: TableCarryingEnv(partner="S99"), UnknownNameError, "unknown simulated pair 'S99'; available: S01"),
        (lambda: TableCarryingEnv(step_limit=0), InvalidValueError, "step_limit: expected at least 1, found 0"),
        (lambda: TableCarryingEnvConfig(step_limit=0), InvalidValueError, "step_limit: expected at least 1, found 0"),
        (
            lambda: TableCarryingEnv(observation_width=63),
            InvalidValueError,
            "observation_width: expected an even number of px from 64 to 3840, found 63",
        ),
        (
            lambda: TableCarryingEnvConfig(observation_height=4000),
            InvalidValueError,
            "observation_height: expected an even number of px from 64 to 3840, found 4000",
        ),
    ],
)
def test_wrong_settings_are_named(make, error, message):
    with pytest.raises(error, match=message):
        make()


@pytest.mark.parametrize(("partner", "expected", "given"), [("", 4, 2), ("S01", 2, 4), ("S01", 2, 1)])
def test_wrong_action_is_named(partner, expected, given):
    env = TableCarryingEnv(partner=partner)
    env.reset(seed=0)
    with pytest.raises(ShapeError, match=rf"^action: expected shape \({expected},\), got \({given},\)$"):
        env.step(np.zeros(given, np.float32))
