import math
from collections import Counter

import numpy as np
import pytest
from constructed_pairs import FREE, ONE, TWO, carried, carried_set, row, trajectories

from copolicy.dataset.statistics.entropy import entropy, jensen_shannon, miller_madow, simpson
from copolicy.dataset.statistics.resampling import Bootstrap
from copolicy.dataset.statistics.route_entropy import label_entropy, route_statistics
from copolicy.tasks.table.statistics.human_routes import human_distance, human_route_entropy, human_routes
from copolicy.tasks.table.statistics.route_statistics import route_statistics as routes_of_tables


def _routes(data):
    bootstrap = Bootstrap(data.pairs, 300, np.random.default_rng(0))
    rng = np.random.default_rng(1)
    return route_statistics(data, bootstrap, rng) | routes_of_tables(data, bootstrap, rng)


def test_entropy_of_known_counts():
    assert entropy(np.array([5, 5, 5, 5])) == pytest.approx(2.0)
    assert entropy(np.array([7, 0])) == 0
    assert miller_madow(np.array([5, 5])) == pytest.approx(1 + 1 / (20 * math.log(2)))
    assert simpson(np.array([5, 5])) == pytest.approx(1 - 40 / 90)
    assert jensen_shannon(np.array([3, 0]), np.array([0, 9])) == pytest.approx(1.0)
    assert jensen_shannon(np.array([3, 1]), np.array([6, 2])) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("obstacles", "plug_in"), [(1, 0.99), (2, 1.71), (3, 1.57)])
def test_the_human_labels_have_the_published_entropies(obstacles, plug_in):
    entry = human_route_entropy(np.random.default_rng(0))[f"{obstacles}_obstacles"]
    assert round(entry["plug_in_bits"], 2) == plug_in
    low, high = entry["interval"]
    assert low < plug_in < high
    assert high - low < 0.5
    assert entry["entropy_bits"] >= entry["plug_in_bits"]


def test_the_packaged_labels_are_the_reference_ones():
    counts = human_routes()
    assert {size: sum(words.values()) for size, words in counts.items()} == {1: 99, 2: 171, 3: 60}
    assert counts[2] == Counter({"LR": 89, "LL": 38, "RR": 30, "RL": 14})


@pytest.mark.parametrize("shares", [(0.5, 0.5), (0.7, 0.3), (0.1, 0.2, 0.3, 0.4)])
def test_nine_in_ten_intervals_or_more_hold_the_true_entropy(shares):
    rng = np.random.default_rng(2)
    truth = -sum(share * math.log2(share) for share in shares)
    hits = 0
    for _ in range(200):
        counts = rng.multinomial(60, shares)
        words = Counter({f"{place:02b}": int(count) for place, count in enumerate(counts) if count})
        low, high = label_entropy(words, 2 if len(shares) > 2 else 1, rng, replicates=300)["interval"]
        hits += low <= truth + 1e-9 and truth - 1e-9 <= high
    assert hits >= 180


def test_the_correction_removes_most_of_the_bias_of_ten_episodes():
    rng = np.random.default_rng(3)
    counts = rng.multinomial(10, [0.25] * 4, size=4000)
    plug_in, corrected = entropy(counts).mean(), miller_madow(counts).mean()
    assert plug_in < 1.85
    assert abs(corrected - 2) < abs(plug_in - 2) / 3


def test_a_single_word_leaves_room_for_one_that_was_not_seen():
    entry = label_entropy(Counter({"L": 10}), 1, np.random.default_rng(0))
    assert entry["entropy_bits"] == 0
    assert entry["interval"][1] == pytest.approx(float(entropy(np.array([1 - 0.05**0.1, 0.05**0.1]))))


def test_entropy_is_that_of_each_configuration_not_of_their_mixture():
    rng = np.random.default_rng(4)
    always = [carried("L", ONE), carried("R", ONE)]
    rows = [row(map_id="a", pair_id="A")] * 20 + [row(map_id="b", pair_id="B")] * 20
    data = trajectories([(always[index // 20], None) for index in range(40)], rows)
    estimates = _routes(data)
    assert estimates["route_entropy"].value == 0
    assert estimates["route_entropy_pooled"].details["1_obstacles"]["plug_in_bits"] == pytest.approx(1.0)
    mixed = carried_set(rng.permutation(["LL", "LR", "RL", "RR"] * 25), TWO, rng)
    estimate = _routes(mixed)["route_entropy"]
    assert estimate.value == pytest.approx(2.0, abs=0.03)
    assert estimate.details["effective_modes"] == pytest.approx(4.0, abs=0.1)
    assert estimate.resampled == "pairs"


def test_routes_are_those_that_were_constructed_and_unfinished_ones_do_not_count():
    words = ["LL", "LR", "RL", "RR"]
    rows = [row(TWO)] * 3 + [row(TWO, success=False)]
    data = trajectories([(carried(word, TWO), None) for word in words], rows)
    assert data.labels == ["LL", "LR", "RL", None]
    assert trajectories([(carried("", FREE), None)], [row(FREE)]).labels == [None]


def test_a_column_that_disagrees_is_counted():
    rows = [row(route_class="L"), row(route_class="R"), row(route_class="")]
    data = trajectories([(carried("L", ONE), None)] * 3, rows)
    details = _routes(data)["route_class"].details
    assert details["unlike_the_episode_column"] == 1
    (sides,) = details["left_by_obstacle"].values()
    assert sides["left"] == [3]
    low, high = sides["left_interval"][0]
    assert 0.4 < low < 0.5
    assert high == pytest.approx(1.0)


def test_few_episodes_give_counts_and_no_entropy():
    data = trajectories([(carried("L", ONE), None)] * 4, [row()] * 4)
    estimate = _routes(data)["route_entropy"]
    assert estimate.value is None
    assert estimate.note == "no configuration has 5 episodes with a route"


def test_routes_in_the_human_shares_are_at_no_distance_in_either_reading():
    rng = np.random.default_rng(5)
    human = ["LR"] * 89 + ["LL"] * 38 + ["RR"] * 30 + ["RL"] * 14
    as_labelled = human_distance(carried_set(human, TWO, rng), rng)["human_distance_2_obstacles"]
    assert as_labelled.value == pytest.approx(0, abs=1e-9)
    assert as_labelled.details["reading"] == "as labelled"
    mirrored = [word.translate(str.maketrans("LR", "RL")) for word in human]
    turned = human_distance(carried_set(mirrored, TWO, rng), rng)["human_distance_2_obstacles"]
    assert turned.value == pytest.approx(0, abs=1e-9)
    assert turned.details["reading"] == "mirrored"
    assert turned.details["as_labelled_bits"] > 0.1


def test_routes_unlike_the_human_ones_are_far_and_beyond_chance():
    rng = np.random.default_rng(6)
    estimates = human_distance(carried_set(["RL"] * 100, TWO, rng), rng)
    estimate = estimates["human_distance_2_obstacles"]
    # One word against the larger of its share and of its mirror image's: 14 and 89 of 171.
    p = 89 / 171
    mixture = np.array([(1 + p) / 2, 38 / 342, 30 / 342, 14 / 342])
    truth = entropy(mixture) - entropy(np.array([89, 38, 30, 14])) / 2
    assert estimate.value == pytest.approx(truth, abs=1e-6)
    assert estimate.interval is not None
    assert estimate.interval[0] < truth < estimate.interval[1]
    assert estimate.null is not None
    assert estimate.null.p < 0.01
    assert estimates["human_distance_1_obstacles"].note == "fewer than 5 episodes with 1 obstacle(s) and a route"
