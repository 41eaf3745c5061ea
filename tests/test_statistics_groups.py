import numpy as np
import pytest
from constructed_pairs import FREE, ONE, carried, row, still, trajectories

from copolicy.dataset.statistics.energy_distance import energy_coefficient, energy_statistics, episode_distances
from copolicy.dataset.statistics.resampling import Bootstrap, circular_shift, exchangeable, permuted_within
from copolicy.dataset.statistics.variance_explained import eta_squared, eta_squared_statistics
from copolicy.dataset.statistics.visitation import Grid, visitation_statistics
from copolicy.tasks.table.scene_outline import TableOutline


def _bootstrap(data):
    return Bootstrap(data.pairs, 200, np.random.default_rng(0))


def _at_cells(rng, columns, frames=400):
    """A table that jumps between the middles of some cells of the top row."""
    states = still(frames, y=12.5)
    states[:, 0] = 12.5 + 25 * rng.permutation(np.resize(columns, frames))
    return states


def test_few_pairs_are_not_drawn_but_their_episodes_are():
    assert Bootstrap(np.arange(4), 10, np.random.default_rng(0)).resampled == "episodes"
    bootstrap = Bootstrap(np.array([0, 0, 1, 1, 2, 3, 4]), 50, np.random.default_rng(0))
    assert bootstrap.resampled == "pairs"
    np.testing.assert_array_equal(bootstrap.weights[:, 0], bootstrap.weights[:, 1])


def test_intervals_of_a_mean_hold_it_where_pairs_differ():
    rng = np.random.default_rng(1)
    hits = 0
    for _ in range(100):
        pairs = np.repeat(np.arange(12), 10)
        values = rng.standard_normal(12)[pairs] + 0.5 * rng.standard_normal(120)
        _, bounds = Bootstrap(pairs, 300, rng).mean(values)
        assert bounds is not None
        hits += bounds[0] <= 0 <= bounds[1]
    assert hits >= 85  # drawing episodes instead would reach about half of that


def test_permutations_stay_within_their_stratum():
    labels, strata = np.array([1, 1, 2, 3, 3, 4]), np.array([0, 1, 0, 1, 1, 0])
    shuffled = permuted_within(labels, strata, np.random.default_rng(0))
    for stratum in (0, 1):
        assert sorted(shuffled[strata == stratum]) == sorted(labels[strata == stratum])
    assert exchangeable(np.array([1, 2, 3, 3]), np.array([0, 0, 1, 1])) == 2


def test_circular_shifts_stay_within_their_episode_and_never_leave_it_as_it_was():
    starts, lengths = np.array([0, 50]), np.array([50, 7])
    for seed in range(20):
        order = circular_shift(starts, lengths, 10, np.random.default_rng(seed))
        assert sorted(order[:50]) == list(range(50))
        assert sorted(order[50:]) == list(range(50, 57))
        assert 10 <= order[0] <= 40


def test_visitation_of_eight_cells_alike_is_three_bits():
    rng = np.random.default_rng(2)
    data = trajectories([(_at_cells(rng, np.arange(8)), None)] * 6, [row(FREE)] * 6)
    estimates = visitation_statistics(data, _bootstrap(data), rng)
    assert estimates["visitation_entropy"].value == pytest.approx(3.0, abs=0.01)
    assert estimates["visitation_coverage"].value == pytest.approx(8 / (48 * 24))


def test_cells_in_an_obstacle_are_not_free():
    outline = TableOutline()
    assert Grid.from_outline(outline).free(outline.fixed(ONE)[2:]).sum() == 48 * 24 - 4


def test_pairs_on_separate_cells_diverge_by_a_bit_and_alike_by_none():
    rng = np.random.default_rng(3)
    apart = [(_at_cells(rng, np.arange(4) + 4 * (n % 2)), None) for n in range(20)]
    data = trajectories(apart, [row(pair_id="AB"[n % 2]) for n in range(20)])
    estimate = visitation_statistics(data, _bootstrap(data), rng)["visitation_divergence_between_pairs"]
    assert estimate.value == pytest.approx(1.0)
    assert estimate.null is not None
    assert estimate.null.p == pytest.approx(1 / 200)
    alike = trajectories([(_at_cells(rng, np.arange(4)), None)] * 20, data.rows)
    estimate = visitation_statistics(alike, _bootstrap(alike), rng)["visitation_divergence_between_pairs"]
    assert estimate.value == pytest.approx(0.0, abs=1e-6)
    assert estimate.null is not None
    assert estimate.null.p == 1


def _distances(values):
    return np.abs(np.subtract.outer(values, values)).astype(float)


def test_energy_coefficient_of_known_distributions():
    labels = np.array([0, 0, 1, 1])
    assert energy_coefficient(_distances([0, 0, 1, 1]), labels) == pytest.approx(1.0)
    assert energy_coefficient(_distances([0, 1, 0, 1]), labels) == pytest.approx(0.0)
    # All at 0 against half at 0 and half at 1: E|X-Y| = E|Y-Y'| = 1/2.
    assert energy_coefficient(_distances([0, 0, 0, 1]), labels) == pytest.approx(0.5)


def test_distances_between_episodes_are_means_over_their_frames():
    near, far = still(10), still(10, x=900.0)  # 600 px are one unit of the scaled x
    data = trajectories([(near, None), (far, None), (near, None)], [row()] * 3)
    expected = [[0, 1, 0], [1, 0, 1], [0, 1, 0]]
    np.testing.assert_allclose(episode_distances(data, np.arange(3)), expected, atol=1e-9)


def test_a_difference_between_pairs_is_found_and_none_is_not():
    rng = np.random.default_rng(4)

    def energies(shift):
        episodes, rows = [], []
        for number in range(60):
            pair = "ABC"[number % 3]
            actions = np.clip(rng.normal(shift * (pair == "C"), 0.3, (60, 4)), -1, 1)
            episodes.append((carried("L", ONE, length=60), actions))
            rows.append(row(pair_id=pair))
        return energy_statistics(trajectories(episodes, rows), rng)

    different = energies(0.4)["energy_between_pairs"]
    assert different.null is not None
    assert different.null.p < 0.01
    each_two = {"".join(entry["pairs"]): entry["p_adjusted"] for entry in different.details["each_two"]}
    assert each_two["AC"] < 0.05
    assert each_two["BC"] < 0.05
    assert each_two["AB"] > 0.05
    alike = energies(0.0)["energy_between_pairs"]
    assert alike.null is not None
    assert alike.null.p > 0.05


@pytest.mark.parametrize(("drift", "found"), [(0.3, True), (0.0, False)])
def test_a_drift_within_pairs_is_found_between_halves(drift, found):
    rng = np.random.default_rng(5)
    episodes = [(None, np.clip(rng.normal(drift * ((number // 2) >= 15), 0.3, (50, 4)), -1, 1)) for number in range(60)]
    data = trajectories(episodes, [row(pair_id="AB"[number % 2]) for number in range(60)])
    null = energy_statistics(data, rng)["energy_between_halves"].null
    assert null is not None
    assert (null.p < 0.01) == found


def test_splits_are_compared_where_there_are_some():
    rows = [row(split="train")] * 10 + [row(split="test")] * 10
    data = trajectories([(still(20), None)] * 10 + [(still(20, x=900.0), None)] * 10, rows)
    estimates = energy_statistics(data, np.random.default_rng(0))
    assert estimates["energy_between_splits"].value == pytest.approx(1.0)
    assert "energy_between_halves" not in estimates
    assert estimates["energy_between_pairs"].note == "there is only one part"


def test_explained_share_of_known_values():
    pairs, strata = np.array([0, 0, 1, 1]), np.zeros(4, dtype=int)
    assert eta_squared(np.array([[1.0], [1], [3], [3]]), pairs, strata) == pytest.approx(1.0)
    assert eta_squared(np.array([[1.0], [3], [1], [3]]), pairs, strata) == pytest.approx(0.0)
    # Means 1 and 3, deviations of 1 about them: 1 of 2.
    assert eta_squared(np.array([[0.0], [2], [2], [4]]), pairs, strata) == pytest.approx(0.5)


def test_routes_that_each_pair_always_takes_are_the_pairs():
    words = ["L", "R"]
    data = trajectories(
        [(carried(words[n % 2], ONE), None) for n in range(40)], [row(pair_id="AB"[n % 2]) for n in range(40)]
    )
    estimate = eta_squared_statistics(data, _bootstrap(data), np.random.default_rng(0))["route_between_pair_share"]
    assert estimate.value == pytest.approx(1.0)
    assert estimate.null is not None
    assert estimate.null.p == pytest.approx(1 / 1000)
    assert estimate.details["adjusted"] == pytest.approx(1.0)


def test_routes_by_the_toss_of_a_coin_are_not_the_pairs():
    rng = np.random.default_rng(6)
    data = trajectories(
        [(carried("LR"[rng.integers(2)], ONE), None) for _ in range(60)],
        [row(pair_id="ABCDE"[n % 5]) for n in range(60)],
    )
    estimate = eta_squared_statistics(data, _bootstrap(data), rng)["route_between_pair_share"]
    assert estimate.null is not None
    assert estimate.null.p > 0.05
    assert estimate.null.mean == pytest.approx(4 / 59, abs=0.02)  # (pairs - 1) / (episodes - 1)


def test_the_share_of_durations_is_that_of_their_variance():
    rng = np.random.default_rng(7)
    rows = [row(pair_id="AB"[n % 2], duration_s=10 + 2 * (n % 2) + rng.standard_normal()) for n in range(400)]
    data = trajectories([(still(5), None)] * 400, rows)
    estimates = eta_squared_statistics(data, _bootstrap(data), rng)
    estimate = estimates["duration_between_pair_share"]
    assert estimate.interval is not None
    assert estimate.interval[0] < 0.5 < estimate.interval[1]  # 1 / (1 + 1)
    assert estimates["duration_between_configuration_share"].note == "one configuration, or nothing varies"


def test_configurations_of_one_episode_each_explain_nothing():
    trips = [(carried("L", ONE), None), (still(5), None)]
    data = trajectories(trips, [row(ONE, duration_s=10.0), row(FREE, duration_s=12.0)])
    estimates = eta_squared_statistics(data, _bootstrap(data), np.random.default_rng(0))
    estimate = estimates["duration_between_configuration_share"]
    assert (estimate.value, estimate.note) == (None, "no configuration has two episodes")


def test_one_pair_has_nobody_to_be_compared_with():
    data = trajectories([(carried("L", ONE), None)] * 6, [row()] * 6)
    estimates = eta_squared_statistics(data, _bootstrap(data), np.random.default_rng(0))
    assert estimates["route_between_pair_share"].note == "no configuration has episodes of two pairs"
    estimates = visitation_statistics(data, _bootstrap(data), np.random.default_rng(0))
    assert estimates["visitation_divergence_between_pairs"].note == "one pair only"
