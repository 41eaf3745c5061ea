"""`copolicy-train export`: the averaged weights alone, the same plans, and nothing of the machine it was made on."""

import json
import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch
from safetensors.torch import load_file, save_file
from training_table import LENGTHS, write_table
from untrained_policy import save_untrained_policy

from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.train.checkpoint import Checkpoint
from copolicy.train.cli import main

DIGEST = "0123456789ab" * 5


@pytest.fixture
def checkpoint(tmp_path) -> Path:
    """A checkpoint whose raw and averaged weights differ, as after a training."""
    folder = save_untrained_policy(tmp_path / "run" / "checkpoints" / "last" / "pretrained_model")
    weights = load_file(folder / "model.safetensors")
    generator = torch.Generator().manual_seed(0)
    for name, values in weights.items():
        if values.is_floating_point():
            weights[name] = 0.05 * torch.randn(values.shape, generator=generator)
    save_file(weights, folder / "model.safetensors")
    training = {
        "dataset": {"repo_id": "lab/table", "root": str(tmp_path / "gone"), "episodes": [0, 2]},
        "output_dir": str(tmp_path / "run"), "steps": 900, "batch_size": 64, "seed": 7,
        "optimizer": {"type": "adamw", "lr": 0.001}, "scheduler": {"type": "copolicy_cosine"},
    }  # fmt: skip
    (folder / "train_config.json").write_text(json.dumps(training), encoding="utf-8")
    state = folder.parent / "training_state"
    state.mkdir()
    (state / "training_step.json").write_text(
        json.dumps({"step": 600, "num_processes": 2, "batch_size": 64}), encoding="utf-8"
    )
    return tmp_path / "run"


def weights_of(folder: Path) -> dict[str, torch.Tensor]:
    return load_file(folder / "model.safetensors")


def result(weights_sha256: str) -> dict:
    """A result of `copolicy-eval`, with a path in it."""
    success = {"mean": 0.5, "standard_error": 0.1, "wilson_95": [0.3, 0.7], "episodes": 2}
    summary = {"success": success, "by_map": {"a": 1}, "planning_ms_per_call": {"p50": 1.0}}
    return {
        "study": "partner",
        "label": "simulated",
        "policy": {"weights_sha256": weights_sha256, "checkpoint": "../../somewhere"},
        "settings": {"maps": "unseen"},
        "summary": summary,
        "episodes": [{"map_id": "a", "success": True, "path": [1, 2], "reason": "goal"}],
        "baselines": [{"name": "passive", "policy": {"checkpoint": "x"}, "summary": summary, "episodes": [1]}],
    }


def test_the_averaged_weights_take_the_place_of_the_raw_ones(checkpoint, tmp_path, capsys):
    out = tmp_path / "model"
    assert main(["export", str(checkpoint), "--out", str(out), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["largest_action_difference"] < 1e-6
    before = weights_of(checkpoint / "checkpoints" / "last" / "pretrained_model")
    after = weights_of(out)
    assert {name for name in after if not name.startswith("denoiser.")} == set()
    for name, values in after.items():
        assert torch.equal(values, before[name.replace("denoiser.", "ema.model.")]), name
        assert not torch.equal(values, before[name]), name
    assert (out / "model.safetensors").stat().st_size < 0.52 * (
        checkpoint / "checkpoints" / "last" / "pretrained_model" / "model.safetensors"
    ).stat().st_size


def test_it_plans_as_the_checkpoint_does(checkpoint, tmp_path):
    out = tmp_path / "model"
    assert main(["export", str(checkpoint), "--out", str(out)]) == 0
    batch = {STATE: torch.rand(3, 3, 7), ENVIRONMENT_STATE: torch.rand(3, 3, 11), HUMAN_ACTION: torch.rand(3, 3, 2)}
    noise = torch.randn(3, 12, 4)
    plans = [Checkpoint(folder).policy.sample_actions(batch, noise=noise) for folder in (checkpoint, out)]
    assert torch.equal(plans[0], plans[1])
    assert plans[0].std() > 0.05


def test_the_recipe_says_how_it_was_made_and_no_path(checkpoint, tmp_path):
    out, commands = tmp_path / "model", tmp_path / "commands.txt"
    commands.write_text(
        "# data\ncopolicy-collect simulate --episodes 2 \\\n    --out recordings\n\ncopolicy-train --steps=9\n",
        encoding="utf-8",
    )
    assert main(["export", str(checkpoint), "--out", str(out), "--commands", str(commands)]) == 0
    recipe = json.loads((out / "recipe.json").read_text(encoding="utf-8"))
    assert recipe["training"] | {"optimizer": 0, "scheduler": 0} == {
        "batch_size": 64, "seed": 7, "steps": 600, "samples": 600 * 64 * 2, "optimizer": 0, "scheduler": 0,
    }  # fmt: skip
    assert recipe["dataset"] == {"repo_id": "lab/table", "revision": None, "episodes_used": 2}
    assert recipe["weights"]["averaged"] is True
    assert recipe["commands"] == [
        "copolicy-collect simulate --episodes 2 --out recordings", "copolicy-train --steps=9",
    ]  # fmt: skip
    assert {path.name for path in out.iterdir()} == {
        "config.json", "model.safetensors", "policy_postprocessor.json", "policy_preprocessor.json", "recipe.json",
    }  # fmt: skip
    for path in out.glob("*.json"):
        assert str(tmp_path) not in path.read_text(encoding="utf-8"), path.name


def test_the_recipe_has_the_facts_of_a_data_set_that_is_at_hand(checkpoint, tmp_path):
    root = write_table(tmp_path / "table")
    episodes = root / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    table = pq.ParquetFile(episodes).read()
    pq.write_table(table.append_column("source", pa.array(["human", *["simulated"] * 5])), episodes)
    config = checkpoint / "checkpoints" / "last" / "pretrained_model" / "train_config.json"
    training = json.loads(config.read_text(encoding="utf-8"))
    config.write_text(
        json.dumps({**training, "dataset": {"repo_id": "lab/table", "root": str(root), "episodes": [0, 2, 5]}}),
        encoding="utf-8",
    )
    out = tmp_path / "model"
    assert main(["export", str(checkpoint), "--out", str(out)]) == 0
    assert json.loads((out / "recipe.json").read_text(encoding="utf-8"))["dataset"] == {
        "repo_id": "lab/table", "revision": None, "episodes": 6, "episodes_used": 3, "frames": sum(LENGTHS), "fps": 10,
        "source": {"simulated": 2, "human": 1},
    }  # fmt: skip
    episodes.write_bytes(episodes.read_bytes()[:-50])
    assert main(["export", str(checkpoint), "--out", str(tmp_path / "other")]) == 2


def test_results_of_the_checkpoint_are_kept_without_paths(checkpoint, tmp_path):
    digest = Checkpoint(checkpoint).weights_sha256
    (tmp_path / "eval.json").write_text(json.dumps(result(digest)), encoding="utf-8")
    out, again = tmp_path / "model", tmp_path / "again"
    assert main(["export", str(checkpoint), "--out", str(out), "--eval", str(tmp_path / "eval.json")]) == 0
    (kept,) = json.loads((out / "eval.json").read_text(encoding="utf-8"))["evaluations"]
    assert kept["policy"] == {"weights_sha256": digest}
    assert kept["episodes"] == [{"map_id": "a", "success": True, "reason": "goal"}]
    assert "by_map" not in kept["summary"]
    (other,) = kept["baselines"]
    assert (other["name"], other["policy"], "episodes" in other) == ("passive", {}, False)
    # So are results of the exported policy: the same command again finds the same weights.
    (tmp_path / "other.json").write_text(json.dumps(result(Checkpoint(out).weights_sha256)), encoding="utf-8")
    flags = ["--out", str(out), "--eval", str(tmp_path / "other.json"), "--overwrite"]
    assert main(["export", str(checkpoint), *flags]) == 0
    # What was exported can be exported again, and keeps its recipe and where it came from.
    assert main(["export", str(out), "--out", str(again), "--eval", str(tmp_path / "eval.json")]) == 0
    assert (again / "recipe.json").read_text(encoding="utf-8") == (out / "recipe.json").read_text(encoding="utf-8")
    assert (again / "model.safetensors").read_bytes() == (out / "model.safetensors").read_bytes()


def test_what_cannot_be_exported_is_named(checkpoint, tmp_path, capsys):
    out, eval_json, commands = tmp_path / "model", tmp_path / "eval.json", tmp_path / "commands.txt"
    eval_json.write_text(json.dumps(result(DIGEST)), encoding="utf-8")
    commands.write_text(f"copolicy-train --dataset.root={Path.home()}/table\n", encoding="utf-8")
    assert main(["export", str(checkpoint), "--out", str(out)]) == 0
    digests = sorted(Checkpoint(folder).weights_sha256[:12] for folder in (checkpoint, out))
    shutil.rmtree(out)
    calls = {
        (
            "--eval",
            str(eval_json),
        ): f"{eval_json}: expected an evaluation of this policy (weights {', '.join(digests)}), "
        f"found one of weights {DIGEST[:12]}",
        ("--eval", str(tmp_path / "no.json")): f"{tmp_path / 'no.json'}: expected a result of copolicy-eval, "
        "found no such file",
        ("--commands", str(commands)): "--commands: expected paths that another machine has too, found "
        f"'copolicy-train --dataset.root={Path.home()}/table'",
    }
    for flags, message in calls.items():
        assert main(["export", str(checkpoint), "--out", str(out), *flags]) == 2
        assert capsys.readouterr().err.splitlines()[-1] == f"copolicy-train: {message}"
        assert not out.exists()
    assert main(["export", str(tmp_path / "nothing"), "--out", str(out)]) == 2
    assert (
        "expected a checkpoint folder with config.json and model.safetensors, found no such" in capsys.readouterr().err
    )


def test_only_a_policy_is_replaced_and_only_when_asked(checkpoint, tmp_path, capsys):
    out, notes = tmp_path / "model", tmp_path / "notes"
    call = ["export", str(checkpoint), "--out"]
    notes.mkdir()
    (notes / "thesis.txt").write_text("years of work", encoding="utf-8")
    assert main([*call, str(notes), "--overwrite"]) == 2
    assert (notes / "thesis.txt").read_text(encoding="utf-8") == "years of work"
    assert main([*call, str(out)]) == 0
    (out / "README.md").write_text("the card of other weights", encoding="utf-8")
    assert main([*call, str(out)]) == 2
    assert "nothing was overwritten" in capsys.readouterr().err
    assert main([*call, str(out), "--overwrite"]) == 0
    assert not (out / "README.md").exists()
    assert {path.name for path in tmp_path.iterdir()} == {"run", "model", "notes"}
