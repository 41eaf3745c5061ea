"""`copolicy-train` in two processes, as a user starts them, and in bf16: they learn what one learns in float32."""

import contextlib
import io
import json
import os
import subprocess
from pathlib import Path

import pytest
import torch
from training_table import flags, losses, new_accelerate, weights, write_table

from copolicy.train.cli import main

_SCRIPT = "import sys; from copolicy.train.cli import main; sys.exit(main())"
_LEARNING = {
    "steps": 30,
    "save_freq": 30,
    "log_freq": 10,
    "seed": 5,
    "policy.scheduler_warmup_steps": 1,
    "policy.optimizer_lr": 0.003,
}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    return write_table(tmp_path_factory.mktemp("data") / "table", (340,) * 4, learnable=True)


def _train(arguments: list[str], **variables: str) -> list[float]:
    """Losses of a training in this process, which has imported LeRobot."""
    said = io.StringIO()
    with new_accelerate(**variables), contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
        assert main(arguments) == 0, said.getvalue()[-3000:]
    return losses(said.getvalue())


@pytest.fixture(scope="module")
def alone(recorded, tmp_path_factory) -> tuple[Path, list[float]]:
    """Output and losses of one process in float32."""
    output = tmp_path_factory.mktemp("alone") / "run"
    return output, _train(flags(recorded, output, batch_size=128, **_LEARNING))


def test_two_processes_learn_as_one_with_the_same_global_batch(recorded, alone, tmp_path, warm_python):
    output, script = tmp_path / "run", tmp_path / "train.py"
    script.write_text(_SCRIPT, encoding="utf-8")
    launcher = [*warm_python, "-m", "torch.distributed.run", "--standalone", "--nproc_per_node", "2", "--no-python"]
    kept = {name: value for name, value in os.environ.items() if not name.startswith("ACCELERATE_")}
    done = subprocess.run(
        [*launcher, *warm_python, str(script), "--json", *flags(recorded, output, batch_size=64, **_LEARNING)],
        env={**kept, "OMP_NUM_THREADS": "1", "HF_HUB_OFFLINE": "1"},
        capture_output=True,
        text=True,
        timeout=400,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    summary = json.loads(done.stdout)  # one object: the other process says nothing
    assert "Effective batch size: 64 x 2 = 128" in done.stderr
    checkpoint = Path(summary["checkpoint"])
    state = json.loads((checkpoint.parent / "training_state" / "training_step.json").read_text(encoding="utf-8"))
    assert (state["step"], state["num_processes"], state["batch_size"]) == (30, 2, 64)
    one, two = alone[1], losses(done.stderr)
    assert len(one) == len(two) == 3
    assert one[0] - one[2] > 0.1, "nothing was learned, so that any two curves agree"
    # Same frames in each step; the diffusion's noise is drawn by each process for itself.
    assert two == pytest.approx(one, abs=0.01)


def test_bf16_learns_the_same_and_leaves_float32_weights(recorded, alone, tmp_path):
    output = tmp_path / "run"
    found = _train(flags(recorded, output, batch_size=128, **_LEARNING), ACCELERATE_MIXED_PRECISION="bf16")
    assert len(found) == 3
    assert found == pytest.approx(alone[1], abs=0.003)
    ours, full = weights(output, 30), weights(alone[0], 30)
    assert {values.dtype for values in ours.values()} == {values.dtype for values in full.values()}
    assert ours["denoiser.head.weight"].dtype == torch.float32
    assert not torch.equal(ours["denoiser.head.weight"], full["denoiser.head.weight"]), "bf16 was not used"
