"""The benchmarks' trainings of rows of settings: resumed, not repeated, and their curves read."""

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from lerobot.configs import PreTrainedConfig
from policy_runs import save_run

from copolicy.train.plugins import register_plugins

sys.path.append(str(Path(__file__).parent / "benchmarks"))

import rival_settings  # pyright: ignore[reportMissingImports]
import rivals  # pyright: ignore[reportMissingImports]
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


def test_the_run_of_a_row_and_seed_is_found(tmp_path):
    assert training_study.training_run(tmp_path) == tmp_path
    (tmp_path / "training").mkdir()
    assert training_study.training_run(tmp_path) == tmp_path / "training"


@pytest.mark.parametrize(
    ("limit", "chosen"), [(1, [0]), (2, [0, 9]), (4, [0, 3, 6, 9]), (10, list(range(10))), (11, list(range(10)))]
)
def test_a_limit_spreads_evenly(limit, chosen):
    assert training_study.spread(range(10), limit) == chosen


@pytest.mark.parametrize("limit", [0, -1])
def test_a_limit_below_one_is_one_line(limit):
    with pytest.raises(SystemExit, match=f"--limit: expected at least 1, found {limit}"):
        training_study.spread(range(10), limit)


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
