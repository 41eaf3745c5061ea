"""LeRobot's own commands train and evaluate the paper's rivals."""

from pathlib import Path

import pytest
from lerobot_evaluation import evaluated
from policy_runs import save_run
from training_table import lerobot_train

from copolicy.dataset.exceptions import RunError

pytestmark = pytest.mark.filterwarnings("ignore:pkg_resources is deprecated")

SMALL = {
    "bc_lstm_gmm": {"width": 8, "n_layers": 1},
    "vrnn": {
        "width": 8, "n_samples": 2, "stride": 2, "history_frames": 4, "window_frames": 8, "encoded_frames": 4,
        "plan_frames": 10, "lookahead_frames": 6,
    },
    "cogail": {},
}  # fmt: skip


def _train(monkeypatch, policy: str, root: Path, out: Path) -> None:
    settings = {"type": policy, "device": "cpu", **SMALL[policy]}
    data = [f"--dataset.root={root}", f"--output_dir={out}", "--batch_size=8", "--steps=2", "--log_freq=1"]
    lerobot_train(monkeypatch, [*data, *(f"--policy.{name}={value}" for name, value in settings.items())])


def _require_evaluated(monkeypatch, policy: str, run: Path, out: Path) -> None:
    checkpoint = run / "checkpoints" / "last" / "pretrained_model"
    seen = evaluated(monkeypatch, policy, checkpoint, out, step_limit=30)
    assert len(seen) == 10  # frames of three steps each


@pytest.mark.parametrize("policy", ["bc_lstm_gmm", "vrnn"])
def test_lerobot_trains_and_evaluates_it(policy, random_table, tmp_path, monkeypatch):
    _train(monkeypatch, policy, random_table, tmp_path / "run")
    _require_evaluated(monkeypatch, policy, tmp_path / "run", tmp_path / "result")


def test_lerobot_evaluates_co_gail(tmp_path, monkeypatch):
    _require_evaluated(monkeypatch, "cogail", save_run(tmp_path / "run", "cogail"), tmp_path / "result")


def test_lerobot_cannot_train_co_gail_and_the_error_names_the_command(random_table, tmp_path, monkeypatch):
    with pytest.raises(RunError, match="use copolicy-train cogail"):
        _train(monkeypatch, "cogail", random_table, tmp_path / "run")
