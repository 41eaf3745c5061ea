import math

import numpy as np
import pytest
from constructed_pairs import ONE, carried, row, still, trajectories

from copolicy.dataset.statistics.forces import activity_statistics, force_statistics, longest_runs
from copolicy.dataset.statistics.leadership import leadership_statistics
from copolicy.dataset.statistics.resampling import Bootstrap
from copolicy.dataset.statistics.smoothness import f95, log_dimensionless_jerk, smoothness_statistics, sparc


def _bootstrap(data):
    return Bootstrap(data.pairs, 300, np.random.default_rng(0))


def _smooth(rng, length, fps):
    noise = rng.standard_normal((length + 2 * fps, 2))
    kernel = np.hanning(max(3, fps // 2))
    smooth = np.column_stack([np.convolve(noise[:, axis], kernel / kernel.sum(), "same") for axis in range(2)])
    return np.clip(smooth[fps : fps + length], -1, 1)


def _followed(rng, fps, lags_s, seconds=30):
    """Player 1 does what player 0 did `lag` before; with several lags each in its turn, 3 s long."""
    length = seconds * fps
    lead = _smooth(rng, length + 2 * fps, fps)
    turn = (np.arange(length) // (3 * fps)) % len(lags_s)
    shift = np.round(np.array(lags_s)[turn] * fps).astype(int)
    base = np.arange(length) + fps
    return np.column_stack((lead[base], lead[base - shift]))


@pytest.mark.parametrize("fps", [10, 30])
@pytest.mark.parametrize(("lag_s", "share"), [(0.2, 1.0), (-0.2, 0.0)])
def test_the_one_whose_actions_come_first_leads(fps, lag_s, share):
    rng = np.random.default_rng(1)
    data = trajectories([(None, _followed(rng, fps, [lag_s])) for _ in range(8)], [row()] * 8, fps)
    estimates = leadership_statistics(data, _bootstrap(data), rng)
    assert estimates["leadership_share"].value == pytest.approx(share, abs=0.02)
    assert estimates["leadership_switches"].value == pytest.approx(0, abs=1)
    null = estimates["leadership_share"].null
    assert null is not None
    assert null.mean == pytest.approx(0.5, abs=0.1)
    assert null.p < 0.05


def test_leaders_in_turns_of_three_seconds_change_twenty_times_a_minute():
    rng = np.random.default_rng(2)
    data = trajectories([(None, _followed(rng, 30, [0.2, -0.2])) for _ in range(12)], [row()] * 12, 30)
    estimates = leadership_statistics(data, _bootstrap(data), rng)
    # Windows across a change hold both lags, so a few more changes are seen than made.
    assert estimates["leadership_switches"].value == pytest.approx(20, abs=6)
    assert estimates["leadership_share"].value == pytest.approx(0.5, abs=0.07)


def test_independent_players_switch_as_often_as_chance_has_it():
    rng = np.random.default_rng(3)
    episodes = [(None, np.hstack((_smooth(rng, 300, 10), _smooth(rng, 300, 10)))) for _ in range(40)]
    data = trajectories(episodes, [row()] * 40)
    estimates = leadership_statistics(data, _bootstrap(data), rng)
    for name in ("leadership_share", "leadership_switches"):
        null = estimates[name].null
        assert null is not None
        assert null.p > 0.05
    assert (estimates["leadership_switches"].value or 0) > 20


def test_players_at_rest_have_no_leader():
    data = trajectories([(None, np.zeros((60, 4)))], [row()])
    estimate = leadership_statistics(data, _bootstrap(data), np.random.default_rng(0))["leadership_share"]
    assert estimate.value is None
    assert estimate.note == "no episode is long enough for a window of 1 s, or nobody moves"


def test_pulling_apart_along_the_table_is_interaction_force():
    actions = np.tile([0.5, 0.0, -0.5, 0.0], (100, 1))
    actions[50:] *= -1
    data = trajectories([(None, actions)] * 6, [row()] * 6)
    estimates = force_statistics(data, _bootstrap(data), np.random.default_rng(0))
    assert estimates["interaction_force_mean"].value == pytest.approx(0.5)
    assert estimates["interaction_force_mean"].interval == pytest.approx((0.5, 0.5))
    assert estimates["interaction_force_p95"].value == pytest.approx(0.5)
    percentiles = estimates["interaction_force_mean"].details["signed_percentiles"]
    assert percentiles["5"] == pytest.approx(-0.5)
    assert percentiles["95"] == pytest.approx(0.5)


def test_conflict_is_the_share_of_opposed_work_and_needs_motion():
    states = still(200)
    states[:100, 4] = 40.0  # to the right, then at rest
    actions = np.tile([0.6, 0.0, 0.2, 0.0], (200, 1))
    actions[:30, 2] = -0.2
    data = trajectories([(states, actions)] * 6, [row()] * 6)
    estimates = force_statistics(data, _bootstrap(data), np.random.default_rng(0))
    assert estimates["conflict_fraction"].value == pytest.approx(0.3)
    assert estimates["effort_asymmetry"].value == pytest.approx(0.5)
    idle = trajectories([(still(50), None)], [row()])
    estimates = force_statistics(idle, _bootstrap(idle), np.random.default_rng(0))
    assert estimates["conflict_fraction"].value is None
    assert estimates["effort_asymmetry"].note == "no player applies a force"


def test_idle_and_saturated_shares():
    actions = np.full((100, 4), 0.5)
    actions[10:50, :2] = 0.0
    actions[75:, 3] = -1.0
    data = trajectories([(None, actions)] * 4, [row()] * 4)
    estimates = activity_statistics(data, _bootstrap(data))
    assert estimates["idle_player_0"].value == pytest.approx(0.4)
    assert estimates["idle_player_0"].details["longest_s"] == pytest.approx(4.0)
    assert estimates["idle_player_1"].value == 0
    assert estimates["saturation_player_0"].value == 0
    assert estimates["saturation_player_1"].value == pytest.approx(0.25)


def test_runs_end_with_their_episode():
    flags = np.array([0, 1, 1, 1, 1, 0, 1], dtype=bool)
    assert longest_runs(flags, np.array([0, 3]), np.array([3, 4])).tolist() == [2, 2]


def test_f95_of_a_sine_and_of_white_noise():
    time = np.arange(0, 60, 0.1)
    sine = np.column_stack((np.sin(2 * np.pi * time), np.zeros(len(time))))
    assert f95(sine, 10) == pytest.approx(1.0, abs=0.4)  # a line is three bins of 0.31 Hz wide in Welch's window
    noise = np.random.default_rng(0).standard_normal((6000, 2))
    assert f95(noise, 10) == pytest.approx(0.95 * 5, abs=0.15)
    assert math.isnan(f95(np.ones((50, 2)), 10))


def test_a_minimum_jerk_movement_has_the_published_smoothness():
    time = np.linspace(0, 1, 301)
    speed = 30 * time**2 * (1 - time) ** 2
    assert log_dimensionless_jerk(speed, 300) == pytest.approx(-math.log(204.8), abs=0.02)
    assert sparc(speed, 300) == pytest.approx(-1.41, abs=0.03)
    twice = np.concatenate((speed, speed))
    assert sparc(twice, 300) < sparc(speed, 300) - 0.2
    assert log_dimensionless_jerk(twice, 300) < log_dimensionless_jerk(speed, 300) - 1
    assert math.isnan(sparc(np.zeros(50), 10))


def test_short_episodes_have_no_spectrum():
    actions = np.random.default_rng(0).uniform(-1, 1, (9, 4))
    data = trajectories([(carried("L", ONE)[:9], actions)], [row()])
    estimate = smoothness_statistics(data, _bootstrap(data))["action_f95_player_0"]
    assert estimate.value is None
    assert estimate.note == "no episode of 1 s in which it moves"
