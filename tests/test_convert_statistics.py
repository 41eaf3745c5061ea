import numpy as np
import pytest
from lerobot.datasets.compute_stats import aggregate_stats, compute_episode_stats

from copolicy.convert.column_statistics import episode_statistics


def columns(frames: int, seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {
        "state": rng.normal(600, 200, (frames, 3)),
        "skewed": rng.exponential(1, (frames, 2)),
        "constant": np.full((frames, 1), 960.0),
        "reward": rng.uniform(-1, 1, frames),
        "done": np.arange(frames) == frames - 1,
        "index": np.arange(frames) + 40,
    }


@pytest.mark.parametrize("frames", [1, 2, 10, 333])
def test_statistics_are_those_of_lerobot(frames):
    data = columns(frames, 0)
    computed = episode_statistics(data)
    # In double precision: LeRobot squares in the precision of its input.
    reference = compute_episode_stats({name: column.astype(float) for name, column in data.items()}, FEATURES)
    for name, expected in reference.items():
        assert set(computed[name]) == set(expected)
        for statistic, value in expected.items():
            assert computed[name][statistic].shape == value.shape, (name, statistic)
            if statistic.startswith("q") and frames > 1:
                bin_width = (expected["max"] - expected["min"]) / 5000
                assert (np.abs(computed[name][statistic] - value) <= bin_width * 1.001 + 1e-9).all(), (name, statistic)
            else:
                assert computed[name][statistic] == pytest.approx(value, rel=1e-9, abs=1e-5), (name, statistic)


def test_aggregated_statistics_are_those_of_all_frames():
    episodes = [columns(frames, seed) for seed, frames in enumerate((50, 120, 31))]
    joined = {name: np.concatenate([episode[name] for episode in episodes]).astype(float) for name in episodes[0]}
    aggregated = aggregate_stats([episode_statistics(episode) for episode in episodes])
    for name, values in joined.items():
        values = values.reshape(len(values), -1)
        assert aggregated[name]["mean"] == pytest.approx(values.mean(axis=0))
        assert aggregated[name]["std"] == pytest.approx(values.std(axis=0))
        assert aggregated[name]["min"] == pytest.approx(values.min(axis=0))
        assert aggregated[name]["max"] == pytest.approx(values.max(axis=0))
        assert aggregated[name]["count"].tolist() == [201]


def test_a_constant_column_has_no_deviation():
    assert episode_statistics({"x": np.full((400, 1), 960, np.float32)})["x"]["std"].tolist() == [0.0]


FEATURES = {name: {"dtype": "float64", "shape": (1,)} for name in columns(1, 0)}
