import numpy as np
import pytest
from constructed_pairs import ONE, TWO, carried, carried_set, row, still, trajectories
from diptest import diptest

from copolicy.dataset.statistics.action_variance import variance_statistics
from copolicy.dataset.statistics.path_modes import count_modes, path_mode_statistics, resample_path
from copolicy.dataset.statistics.resampling import Bootstrap
from copolicy.tasks.table.statistics.steering_dip import decision_zone, dip_statistics, dip_tests, steering


def _bootstrap(data):
    return Bootstrap(data.pairs, 300, np.random.default_rng(0))


def test_points_are_even_in_arc_length_whatever_the_pace():
    pace = np.concatenate((np.zeros(5), np.linspace(0, 1, 50) ** 2, np.ones(5)))
    path = np.column_stack((100 * pace, 100 * pace))
    np.testing.assert_allclose(resample_path(path, 11)[:, 0], np.linspace(0, 100, 11), atol=1.0)


@pytest.mark.parametrize("episodes", [12, 40])
@pytest.mark.parametrize("words", [["LL"], ["LL", "RR"], ["LL", "LR", "RR"]])
def test_modes_are_those_that_were_constructed(words, episodes):
    rng = np.random.default_rng(1)
    data = carried_set((words * episodes)[:episodes], TWO, rng, jitter=8.0)
    estimate = path_mode_statistics(data, seed=0)["path_modes"]
    assert estimate.value == len(words)
    if episodes == 40:
        assert estimate.interval == (len(words), len(words))
    (entry,) = estimate.details["configurations"].values()
    assert entry["adjusted_rand"] == pytest.approx(1.0)


def test_paths_nearer_than_the_resolution_are_one_mode():
    paths = np.array([resample_path(carried("L", ONE, amplitude=100 + 8 * (n % 2))[:, :2]) for n in range(30)])
    assert count_modes(paths, seed=0, resolution=10.0)[0] == 1


def test_few_episodes_have_no_modes():
    data = carried_set(["LL"] * 7, TWO, np.random.default_rng(0))
    estimate = path_mode_statistics(data, seed=0)["path_modes"]
    assert estimate.value is None
    assert estimate.note == "no configuration has 8 episodes that reached the goal"


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.3])
def test_the_action_variance_ratio_is_the_share_of_noise(noise):
    # a = signal(x) + noise; uniform places, so the signal's variance is that of a line over the world.
    rng = np.random.default_rng(2)
    episodes = []
    for _ in range(40):
        states = still(200)
        states[:, :2] = rng.uniform((200, 100), (1000, 500), (200, 2))
        signal = np.tile(((states[:, :1] - 600) / 400 * 0.5), (1, 4))
        episodes.append((states, signal + noise * rng.standard_normal((200, 4))))
    data = trajectories(episodes, [row()] * 40)
    estimates = variance_statistics(data, _bootstrap(data), rng)
    truth = noise**2 / (0.25 / 3 + noise**2)
    assert estimates["action_variance_ratio"].value == pytest.approx(truth, abs=0.03)
    assert estimates["action_variance_ratio_player_1"].value == pytest.approx(truth, abs=0.03)
    interval = estimates["action_variance_ratio"].interval
    assert interval is not None
    assert interval[1] - interval[0] < 0.1


def test_actions_that_do_not_depend_on_the_state_have_ratio_one():
    rng = np.random.default_rng(3)
    data = trajectories([(carried("L", ONE), rng.uniform(-1, 1, (120, 4))) for _ in range(30)], [row()] * 30)
    assert variance_statistics(data, _bootstrap(data), rng)["action_variance_ratio"].value == pytest.approx(
        1.0, abs=0.05
    )


def test_frames_of_one_episode_count_once_and_never_for_their_own():
    # Each episode has an action of its own and all share one path: the place tells nothing. Its own frames would say
    # that nothing varies, and many frames of few others that little does.
    rng = np.random.default_rng(4)
    level = rng.uniform(-1, 1, (30, 4))
    data = trajectories([(carried("L", ONE), np.tile(level[n], (120, 1))) for n in range(30)], [row()] * 30)
    estimate = variance_statistics(data, _bootstrap(data), rng)["action_variance_ratio"]
    assert estimate.value == pytest.approx(1.0, abs=0.1)


def test_noise_that_lasts_counts_as_noise():
    rng = np.random.default_rng(6)
    episodes, kept = [], np.exp(-1 / 10)
    offsets = np.linspace(-100, 100, 40)
    for offset in offsets:
        states = still(120)
        states[:, 0], states[:, 1] = np.linspace(240, 960, 120), 300 + offset
        noise = rng.standard_normal((120, 4))
        for step in range(1, 120):
            noise[step] = kept * noise[step - 1] + np.sqrt(1 - kept**2) * noise[step]
        episodes.append((states, 0.2 * offset / offsets.std() + 0.2 * noise))
    data = trajectories(episodes, [row()] * 40)
    estimate = variance_statistics(data, _bootstrap(data), rng)["action_variance_ratio"]
    assert estimate.interval is not None
    assert estimate.interval[0] < 0.5 < estimate.interval[1]
    assert estimate.value == pytest.approx(0.5, abs=0.06)


def test_a_signal_between_neighbours_is_no_noise():
    # Few episodes on a steep line and no noise at all: neighbours differ, but only by what the state explains.
    rng = np.random.default_rng(7)
    offsets = np.linspace(-100, 100, 20)
    episodes = []
    for offset in offsets:
        states = still(60)
        states[:, 0], states[:, 1] = np.linspace(240, 960, 60), 300 + offset
        episodes.append((states, np.full((60, 4), offset / 200)))
    data = trajectories(episodes, [row()] * 20)
    estimate = variance_statistics(data, _bootstrap(data), rng)["action_variance_ratio"]
    among = estimate.details["among_episodes"]
    assert among["2"] < among["4"] < among["8"]
    assert among["8"] > 0.05
    assert estimate.value == pytest.approx(0.0, abs=0.01)


def test_without_enough_other_episodes_there_is_no_ratio():
    data = trajectories([(still(20), None)] * 8, [row()] * 8)
    estimate = variance_statistics(data, _bootstrap(data), np.random.default_rng(0))["action_variance_ratio"]
    assert estimate.value is None
    assert estimate.note == "no goal and obstacles with 9 episodes"


def test_the_decision_zone_ends_at_the_near_side_of_the_first_obstacle():
    states = carried("L", ONE, length=721)  # 1 px a frame from x = 240
    data = trajectories([(states, None)], [row()])
    zone = decision_zone(data)
    assert zone[: 600 - 25 - 240].all()
    assert not zone[600 - 25 - 240 :].any()


def test_steering_is_across_start_and_goal():
    actions = np.array([[0.3, 0.4, 0.1, 0.2]])
    assert steering(trajectories([(None, actions)], [row()])) == pytest.approx([0.6])


@pytest.mark.parametrize(("split", "expected"), [(0.5, 1.0), (0.0, 0.0)])
def test_the_dip_finds_pairs_that_split_before_the_obstacle(split, expected):
    rng = np.random.default_rng(5)
    episodes, rows = [], []
    for number in range(60):
        states = still(40)
        states[:, 0] = np.linspace(240, 560, 40)
        side = split if number % 2 else -split
        actions = np.clip(rng.normal(side / 2, 0.05, (40, 4)), -1, 1) + rng.normal(0, 0.05)
        episodes.append((states, actions))
        rows.append(row(pair_id="ABCDE"[number % 5]))
    data = trajectories(episodes, rows)
    estimates = dip_statistics(data, _bootstrap(data), rng)
    assert estimates["steering_dip"].value == pytest.approx(expected, abs=0.02)
    assert estimates["steering_dip_by_configuration"].value == expected
    null = estimates["steering_dip"].null
    assert null is not None
    assert null.high < 0.05


def test_dips_and_their_p_are_those_of_the_library():
    rng = np.random.default_rng(8)
    sizes = [4, 5, 8, 9, 10, 11, 17, 50, 333, 72_000, 9, 4]
    samples = [rng.standard_normal(size) + 3 * (rng.random(size) < 0.5) * (size % 2) for size in sizes]
    samples += [np.zeros(12), np.repeat([0.0, 1.0], 10)]
    dips, p = dip_tests(samples)
    expected = np.array([diptest(sample)[:2] for sample in samples])
    np.testing.assert_array_equal(dips, expected[:, 0])
    np.testing.assert_array_equal(p, expected[:, 1].clip(0.0, 1.0))
