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
    ours = episode_statistics(data)
    # In double precision: LeRobot squares in the precision of its input.
    theirs = compute_episode_stats({name: column.astype(float) for name, column in data.items()}, FEATURES)
    for name, expected in theirs.items():
        assert set(ours[name]) == set(expected)
        for kind, value in expected.items():
            assert ours[name][kind].shape == value.shape, (name, kind)
            if kind.startswith("q") and frames > 1:
                bin_width = (expected["max"] - expected["min"]) / 5000
                assert (np.abs(ours[name][kind] - value) <= bin_width * 1.001 + 1e-9).all(), (name, kind)
            else:
                assert ours[name][kind] == pytest.approx(value, rel=1e-9, abs=1e-5), (name, kind)


def test_aggregated_statistics_are_those_of_all_frames():
    parts = [columns(frames, seed) for seed, frames in enumerate((50, 120, 31))]
    whole = {name: np.concatenate([part[name] for part in parts]).astype(float) for name in parts[0]}
    found = aggregate_stats([episode_statistics(part) for part in parts])
    for name, values in whole.items():
        values = values.reshape(len(values), -1)
        assert found[name]["mean"] == pytest.approx(values.mean(axis=0))
        assert found[name]["std"] == pytest.approx(values.std(axis=0))
        assert found[name]["min"] == pytest.approx(values.min(axis=0))
        assert found[name]["max"] == pytest.approx(values.max(axis=0))
        assert found[name]["count"].tolist() == [201]


def test_a_constant_column_has_no_deviation():
    assert episode_statistics({"x": np.full((400, 1), 960, np.float32)})["x"]["std"].tolist() == [0.0]


FEATURES = {name: {"dtype": "float64", "shape": (1,)} for name in columns(1, 0)}
