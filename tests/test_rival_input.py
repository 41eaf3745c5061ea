"""Input that does not fit a method: one line each, whichever command gets it."""

import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import pyarrow.parquet as pq
import pytest
from policy_runs import save_run

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.evaluate.cli import main as evaluate
from copolicy.train.cli import main as train
from copolicy.train.suitability import require_fitting_data


def _refused(capsys, main, *flags: object) -> str:
    capsys.readouterr()
    assert main([str(flag) for flag in flags]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    # The refusal is the last line and the only one of the command; libraries may log before it.
    assert [line for line in lines if line.startswith(("copolicy-", "Traceback"))] == lines[-1:], lines
    return lines[-1]


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
def data_set(sound_recordings, sound) -> Path:
    """A data set of 10 Hz."""
    return sound_recordings.parent / "set"


def _without(data_set: Path, column: str, folder: Path) -> Path:
    """A copy of a data set without a column."""
    shutil.copytree(data_set, folder)
    for name, part in (("info.json", "features"), ("stats.json", None)):
        content = json.loads((folder / "meta" / name).read_text(encoding="utf-8"))
        (content[part] if part else content).pop(column)
        (folder / "meta" / name).write_text(json.dumps(content), encoding="utf-8")
    for path in folder.glob("data/*/*.parquet"):
        table = pq.read_table(path).drop_columns([column])
        metadata = {key: value for key, value in (table.schema.metadata or {}).items() if key != b"huggingface"}
        pq.write_table(table.replace_schema_metadata(metadata), path)
    return folder


@pytest.mark.parametrize("column", [ENVIRONMENT_STATE, STATE])
def test_data_without_a_column_that_a_method_reads(data_set, tmp_path, capsys, column):
    root, out = _without(data_set, column, tmp_path / "set"), tmp_path / "out"
    rest = ("--policy.device=cpu", "--steps=1", "--batch_size=2", f"--dataset.root={root}", f"--output_dir={out}")
    for command, policy in (((), "bc_lstm_gmm"), ((), "act"), ((), "diffusion"), (("cogail",), "cogail")):
        line = _refused(capsys, train, *command, f"--policy.type={policy}", *rest)
        found = f"{root}: expected the column {column}, which {policy} reads, found action, "
        assert line.startswith(f"copolicy-train: {found}")
        assert not out.exists()


def test_the_partners_action_is_needed_where_a_setting_reads_it(data_set, tmp_path, capsys):
    root, out = _without(data_set, HUMAN_ACTION, tmp_path / "set"), tmp_path / "out"
    flags = ("--policy.code=inferred", f"--dataset.root={root}", f"--output_dir={out}")
    line = _refused(capsys, train, "cogail", *flags)
    assert f"{root}: expected the column {HUMAN_ACTION}, which cogail reads, found " in line


def test_a_resumed_run_keeps_its_method_and_rate(data_set, tmp_path, capsys):
    out = tmp_path / "run"
    flags = ("--policy.type=bc_lstm_gmm", "--policy.width=8", "--policy.device=cpu", "--batch_size=2")
    assert train([*flags, "--steps=1", f"--dataset.root={data_set}", f"--output_dir={out}"]) == 0
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    resumed = (f"--config_path={out}", "--resume=true", "--steps=2")
    checkpoint = out / "checkpoints" / "last" / "pretrained_model"
    line = _refused(capsys, train, *resumed, "--policy.type=vrnn")
    assert line == f"copolicy-train: {checkpoint}: expected a run of vrnn, as --policy.type says, found bc_lstm_gmm"
    line = _refused(capsys, train, "cogail", *resumed)
    assert (
        line
        == f"copolicy-train: {checkpoint}: expected cogail, or the command copolicy-train alone, found 'bc_lstm_gmm'"
    )
    other = shutil.copytree(data_set, tmp_path / "other")
    info = json.loads((other / "meta" / "info.json").read_text(encoding="utf-8"))
    (other / "meta" / "info.json").write_text(json.dumps(info | {"fps": 30}), encoding="utf-8")
    line = _refused(capsys, train, *resumed, f"--dataset.root={other}")
    found = f"{other}: expected 10 frames a second, as in the data of the resumed run {checkpoint}, found 30"
    assert line == f"copolicy-train: {found}"
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("flag", ["config_path", "policy.path"])
def test_a_folder_without_a_checkpoint(tmp_path, capsys, flag):
    folder = tmp_path / "recordings"
    folder.mkdir()
    assert train([f"--{flag}={folder}", f"--dataset.root={tmp_path}"]) == 2
    expected = f"a checkpoint or the folder of a run for --{flag}"
    assert capsys.readouterr().err == f"copolicy-train: {folder}: expected {expected}, found none in this folder\n"


def test_a_renamed_column_is_found(data_set, tmp_path):
    root = _without(data_set, STATE, tmp_path / "set")
    info = json.loads((root / "meta" / "info.json").read_text(encoding="utf-8"))
    config = SimpleNamespace(resume=False, policy=SimpleNamespace(type="act"), rename_map={"observation.pose": STATE})
    config.dataset = SimpleNamespace(root=root)
    with pytest.raises(FileFormatError, match=f"the column {STATE}, which act reads"):
        require_fitting_data(config, None)
    info["features"]["observation.pose"] = {"dtype": "float32", "shape": [7]}
    (root / "meta" / "info.json").write_text(json.dumps(info), encoding="utf-8")
    require_fitting_data(config, None)


def test_a_rate_that_the_task_does_not_have(tmp_path, capsys):
    run = save_run(tmp_path / "bc", "bc_lstm_gmm", fps=12.0)
    line = _refused(capsys, evaluate, "coplan", "--policy", run, "--out", tmp_path / "e.json")
    assert line == "copolicy-eval: fps: expected a divisor of 30 [1, 2, 3, 5, 6, 10, 15, 30], found 12"
