"""Success on random layouts, a benchmark."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from untrained_policy import save_untrained_policy

sys.path.append(str(Path(__file__).parent / "benchmarks"))

import random_layouts  # pyright: ignore[reportMissingImports]


def test_layouts_depend_on_the_seed_alone():
    first, again, other = (random_layouts.layouts(5, seed) for seed in (1, 1, 2))
    assert first == again != other
    assert all(1 <= len(scenario.obstacles) <= 3 for scenario in first)


def test_a_method_has_the_spread_of_its_seeds_and_its_difference_to_the_first():
    first = np.ones((1, 4), bool)
    method = np.array([[True, True, False, False], [True, True, True, True]])
    n_obstacles = np.array([1, 2, 3, 3])
    cells = random_layouts.line("B", method, first, n_obstacles).split(" | ")
    assert cells[:3] == ["| B", "2", "75.0 ± 25.0 %"]
    assert cells[3].startswith("+25.0 ± ")
    assert cells[4:] == ["100.0 ± 0.0 %", "100.0 ± 0.0 %", "50.0 ± 50.0 % |"]


def test_runs_of_a_method_are_the_folders_of_its_seeds(tmp_path):
    for seed in ("seed_0", "seed_1"):
        (tmp_path / "runs" / seed / "training").mkdir(parents=True)
    runs = [str(tmp_path / "runs" / seed / "training") for seed in ("seed_0", "seed_1")]
    assert random_layouts.policies_of(f"A={tmp_path / 'runs'}") == ("A", runs)
    for policy in ("pretrained", "runs/lr=1/training"):
        assert random_layouts.policies_of(policy) == (policy, [policy])
    (tmp_path / "empty").mkdir()
    with pytest.raises(SystemExit, match="empty: expected a folder for each training seed, found none"):
        random_layouts.policies_of(f"A={tmp_path / 'empty'}")


def test_the_table_and_the_successes(tmp_path, monkeypatch, capsys):
    policy, out = str(save_untrained_policy(tmp_path / "policy")), tmp_path / "out.json"
    monkeypatch.setattr(sys, "argv", ["x", policy, "--layouts", "3", "--seed", "5", "--out", str(out)])
    random_layouts.main()
    assert f"| {policy} | 1 | 0.0 ± 0.0 % |  |" in capsys.readouterr().out
    assert json.loads(out.read_text(encoding="utf-8"))["successes"] == {policy: [[False, False, False]]}
