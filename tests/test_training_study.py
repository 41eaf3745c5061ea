"""The benchmarks' trainings of rows of settings: resumed, not repeated, and their curves read."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from lerobot.configs import PreTrainedConfig
from policy_runs import save_run

from copolicy.collect.episodes import run_episodes
from copolicy.dataset.task import get_task
from copolicy.train.checkpoint import Checkpoint
from copolicy.train.plugins import register_plugins

sys.path.append(str(Path(__file__).parent / "benchmarks"))

import handover  # pyright: ignore[reportMissingImports]
import rival_settings  # pyright: ignore[reportMissingImports]
import rivals  # pyright: ignore[reportMissingImports]
import routes_and_success  # pyright: ignore[reportMissingImports]
import training_study  # pyright: ignore[reportMissingImports]

ROW = training_study.Row(policy="bc_lstm_gmm", preset="paper", steps=100, batch=8, bf16=False)


@pytest.fixture
def calls(monkeypatch) -> list[tuple[str, ...]]:
    """The flags of the commands, which are not run."""
    made: list[tuple[str, ...]] = []
    monkeypatch.setattr(training_study, "run_command", lambda *flags, **about: made.append(flags))
    return made


def test_a_training_begins_resumes_and_ends(tmp_path, calls):
    folder = tmp_path / "seed_3"
    training_study.train(ROW, tmp_path / "pairs", folder, 3, checkpoints=5)
    name, *flags = calls.pop()
    assert name == "copolicy-train"
    assert {"--policy.type=bc_lstm_gmm", "--steps=100", "--save_freq=20", "--log_freq=4", "--seed=3"} <= set(flags)
    # Finished: not again, and not with other settings.
    training_study.train(ROW, tmp_path / "pairs", folder, 3, checkpoints=5)
    assert calls == []
    with pytest.raises(SystemExit, match="give another --out"):
        training_study.train(training_study.Row(steps=7), tmp_path / "pairs", folder, 3)
    (folder / "finished.json").unlink()
    save_run(folder / "training", "bc_lstm_gmm", 3, reached=40)
    training_study.train(ROW, tmp_path / "pairs", folder, 3)
    assert calls.pop()[1:3] == (f"--config_path={folder / 'training'}", "--resume=true")
    (folder / "finished.json").unlink()
    (folder / "training" / "checkpoints" / "000040").rename(folder / "training" / "checkpoints" / "000100")
    (folder / "training" / "checkpoints" / "last").unlink()
    (folder / "training" / "checkpoints" / "last").symlink_to("000100")
    training_study.train(ROW, tmp_path / "pairs", folder, 3)
    assert calls == []


def test_losses_of_a_resumed_training_are_not_counted_twice(tmp_path):
    line = "INFO ot_train.py:641 step:{} smpl:3K ep:19 epch:0.05 loss:{} grdn:2.381 lr:5.1e-06 updt_s:0.5"
    log = [
        "training_study: from step 0, logged every 10",
        line.format("10", "3.5"), line.format("20", "-1.25"), line.format("30", "9.0"),
        "training_study: from step 20, logged every 10",
        line.format("30", "-2.0"), line.format("1K", "-2.5"),
    ]  # fmt: skip
    (tmp_path / "training.log").write_text("\n".join(log), encoding="utf-8")
    assert training_study.losses(tmp_path, 8) == [(80, 3.5), (160, -1.25), (240, -2.0), (320, -2.5)]
    own = tmp_path / "training" / "training_log.jsonl"
    own.parent.mkdir()
    own.write_text('{"step": 6000, "discriminator_loss": 0.7}\n', encoding="utf-8")
    assert training_study.losses(tmp_path, 1) == [(6000, 0.7)]


def test_curves_are_of_the_checkpoints_along_a_training(tmp_path):
    (tmp_path / "data" / "pairs-sim-376").mkdir(parents=True)
    arguments = SimpleNamespace(out=tmp_path, checkpoints=2, scale=0.5, limit=None, rows=["codp-h"], data=None)
    study = rivals.Study(arguments)
    assert study.row("codp-h").steps == 3000
    for step, success in (("001500", 0.25), ("003000", 0.75)):
        path = tmp_path / "curves" / "codp-h" / "seed_0" / f"{step}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"summary": {"success": {"mean": success}}}), encoding="utf-8")
    (tmp_path / "runs" / "codp-h" / "seed_0").mkdir(parents=True)
    (tmp_path / "runs" / "codp-h" / "seed_0" / "training.log").write_text("", encoding="utf-8")
    curves = study.curves(["codp-h"], [0])
    ((points, losses),) = curves["codp-h"]
    assert [(point.samples, point.success) for point in points] == [(768_000, 0.25), (1_536_000, 0.75)]
    assert losses == []
    rivals.save_curves(curves, tmp_path / "curves.png")
    assert (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")


def test_every_row_names_its_budget():
    table = rivals.budgets(rivals.ROWS)
    assert table.count("\n") == len(rivals.ROWS) + 1
    assert "| bc-scan-10hz | bc_lstm_gmm, scan | pairs-sim-376 | 10 | 6,000 | 100 |" in table


def test_rows_that_read_the_obstacles_as_a_list_learn_from_every_order():
    lists = "--policy.observation_features=absolute"
    for name, row in rivals.ROWS.items():
        scans = row.preset in ("scan", "small", "cnn-small") and lists not in row.flags
        assert (row.recipe != "pairs-sim-376-orders") == scans, name
    turned = {name for name, row in rivals.ROWS.items() if row.recipe == "pairs-sim-376-orientations"}
    assert turned == {"codp-h-orientations", "bc-scan-10hz-orientations"}


@pytest.mark.parametrize("kind", rival_settings.CHANGES)
def test_a_changed_setting_is_one_of_the_policy_and_another_value(kind):
    register_plugins()
    preset = {"bc_lstm_gmm": "normalized", "cogail": "corrected", "vrnn": "default"}[kind]
    trained = PreTrainedConfig.get_choice_class(kind)(device="cpu", preset=preset)
    for changes in rival_settings.CHANGES[kind].values():
        assert all(getattr(trained, name) != value for name, value in changes.items())
        PreTrainedConfig.get_choice_class(kind)(device="cpu", preset=preset, **changes)


def test_a_policy_takes_over_from_a_demonstration_at_a_place(tmp_path):
    """The states before are the recorded ones, to the last digit; it observes them, and acts from there on."""
    (recorded,) = run_episodes("scripted:S01", "scripted:S01", limit=1)
    policy = Checkpoint(save_run(tmp_path / "run", "bc_lstm_gmm"))
    (own,) = handover.continued(policy, [recorded], 0.0)
    (continued,) = handover.continued(policy, [recorded], 480.0)
    taken = int(np.argmax(recorded.states[:, 0] >= 480.0))
    assert taken > 100
    assert np.array_equal(continued.states[: taken + 1], recorded.states[: taken + 1])
    assert np.array_equal(continued.actions[:taken], recorded.actions[:taken])
    assert not np.array_equal(continued.actions[taken], recorded.actions[taken])
    assert not np.array_equal(own.actions[0], recorded.actions[0])


@pytest.mark.parametrize(
    ("end_x", "reason", "place", "expected"),
    [
        (470.0, "collision_obstacle", 0.0, {"column at 480 px": (1, 1), "column at 720 px": (0, 0)}),
        (700.0, "collision_obstacle", 0.0, {"column at 480 px": (0, 1), "column at 720 px": (1, 1)}),
        (700.0, "collision_obstacle", 540.0, {"column at 720 px": (1, 1)}),
        (900.0, "goal", 0.0, {"column at 480 px": (0, 1), "column at 720 px": (0, 1)}),
    ],
)
def test_a_failure_counts_at_the_column_of_obstacles_before_which_it_ended(end_x, reason, place, expected):
    path = np.linspace([240.0, 300.0], [end_x, 300.0], 50)
    episode: Any = SimpleNamespace(
        states=path[:-1],
        final_state=path[-1],
        meta=SimpleNamespace(success=reason == "goal"),
        scenario=SimpleNamespace(obstacles=((480.0, 300.0), (720.0, 180.0))),
    )
    assert handover.obstacle_failures([episode], place) == expected


def test_kinds_of_maps_are_compared_within_equally_many_obstacles():
    """Not over all maps: those with several routes are most of the difficult ones."""
    one = [(0.9, 1, True), (0.9, 1, True), (0.8, 1, True), (0.4, 2, True), (0.3, 2, True)]
    several = [(0.7, 1, False), (0.6, 1, False), (0.2, 2, False), (0.1, 2, False), (0.15, 2, False), (0.0, 3, False)]
    row = routes_and_success.compare(*zip(*one, *several, strict=True))
    assert row["one_route"] == {"mean": pytest.approx(0.66), "maps": 5}
    assert row["several"] == {"mean": pytest.approx(1.75 / 6), "maps": 6}
    # At one obstacle 0.65 - 0.8667 and at two 0.15 - 0.35, each weighted by 1 / (1/3 + 1/2).
    assert row["difference"] == pytest.approx((0.65 - 2.6 / 3 - 0.2) / 2)
    variances = (0.01 / 3 / 3 + 0.005 / 2, 0.005 / 2 + 0.0025 / 3)
    assert row["standard_error"] == pytest.approx(sum(variances) ** 0.5 / 2)


def test_a_map_is_the_same_in_any_order_of_its_obstacles():
    scenario = get_task().scenario_set("holdout").scenarios[-1]
    turned = replace(scenario, obstacles=scenario.obstacles[::-1])
    assert len(scenario.obstacles) > 1
    assert routes_and_success.key(turned) == routes_and_success.key(scenario)
    moved = replace(scenario, obstacles=((1.0, 2.0), *scenario.obstacles[1:]))
    assert routes_and_success.key(moved) != routes_and_success.key(scenario)
