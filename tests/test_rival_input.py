"""Input that does not fit a method: one line each, whichever command gets it."""

import json
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from policy_runs import save_run

from copolicy.dataset.features import ENVIRONMENT_STATE
from copolicy.evaluate.cli import main as evaluate
from copolicy.train.cli import main as train


def _refused(capsys, main, *flags: object, status: int = 2) -> str:
    capsys.readouterr()
    assert main([str(flag) for flag in flags]) == status
    return capsys.readouterr().err.strip().splitlines()[-1]


def test_settings_of_one_method_for_a_checkpoint_of_another(tmp_path, capsys):
    run = save_run(tmp_path / "bc", "bc_lstm_gmm")
    data = (f"--dataset.root={tmp_path}", f"--output_dir={tmp_path / 'out'}")
    line = _refused(capsys, train, f"--policy.path={run}", "--policy.preset=small", *data)
    assert line == "copolicy-train: unknown preset 'small'; available: normalized, paper, scan"
    line = _refused(capsys, evaluate, "coplan", "--policy", run, "--sampler", "ddim", "--out", tmp_path / "e.json")
    assert line.endswith("expected a policy with the setting 'sampler', found bc_lstm_gmm without it")


def test_plans_need_action_chunks(tmp_path, capsys):
    run = save_run(tmp_path / "bc", "bc_lstm_gmm")
    line = _refused(capsys, evaluate, "plans", "--policy", run, "--map", 0, "--out", tmp_path / "plans.png")
    assert "--policy: expected a policy of action chunks, found" in line
    assert "which acts frame by frame" in line
    assert not (tmp_path / "plans.png").exists()


def test_a_contradiction_between_settings_of_lerobots_diffusion_has_its_reason(tmp_path, capsys):
    data = (f"--dataset.root={tmp_path}", f"--output_dir={tmp_path / 'out'}")
    line = _refused(capsys, train, "--policy.type=diffusion", "--policy.horizon=12", *data)
    assert "Couldn't instantiate class DiffusionConfig using the given arguments. The horizon should be" in line


@pytest.fixture(scope="module")
def without_scenario(sound_recordings, sound, tmp_path_factory) -> Path:
    """A data set without the column of start, goal and obstacles."""
    folder = tmp_path_factory.mktemp("sets") / "set"
    shutil.copytree(sound_recordings.parent / "set", folder)
    for name, part in (("info.json", "features"), ("stats.json", None)):
        content = json.loads((folder / "meta" / name).read_text(encoding="utf-8"))
        (content[part] if part else content).pop(ENVIRONMENT_STATE)
        (folder / "meta" / name).write_text(json.dumps(content), encoding="utf-8")
    for path in folder.glob("data/*/*.parquet"):
        table = pq.read_table(path).drop_columns([ENVIRONMENT_STATE])
        metadata = {key: value for key, value in (table.schema.metadata or {}).items() if key != b"huggingface"}
        pq.write_table(table.replace_schema_metadata(metadata), path)
    return folder


@pytest.mark.parametrize(
    ("policy", "status", "found"),
    [
        ("bc_lstm_gmm", 2, "expected observation.environment_state, found ['observation.human_action',"),
        ("act", 1, "You must provide at least one image or the environment state among the inputs."),
    ],
)
def test_data_without_a_column_that_a_method_reads(without_scenario, tmp_path, capsys, policy, status, found):
    flags = (f"--policy.type={policy}", "--policy.device=cpu", "--steps=1", "--batch_size=2")
    out = f"--output_dir={tmp_path / 'out'}"
    line = _refused(capsys, train, *flags, f"--dataset.root={without_scenario}", out, status=status)
    assert found in line


def test_a_rate_that_the_task_does_not_have(tmp_path, capsys):
    run = save_run(tmp_path / "bc", "bc_lstm_gmm", fps=12.0)
    line = _refused(capsys, evaluate, "coplan", "--policy", run, "--out", tmp_path / "e.json")
    assert line == "copolicy-eval: fps: expected a divisor of 30 [1, 2, 3, 5, 6, 10, 15, 30], found 12"
