import hashlib
import json
from pathlib import Path

import pytest
import yaml
from huggingface_hub import ModelCard
from made_once import simulated

from copolicy.cards.cli import main
from copolicy.convert.cli import main as convert

WEIGHTS = b"the weights"


def _evaluation(maps: str = "holdout", mean: float = 0.75, complete: bool = True) -> dict:
    """What `copolicy-eval coplan` writes, without its episodes."""
    return {
        "study": "coplan",
        "label": "co-planning in simulation: no person took part",
        "policy": {
            "weights_sha256": hashlib.sha256(WEIGHTS).hexdigest(), "parameters": 1_132_464, "sampler": "ddim",
            "num_inference_steps": 10, "initial_noise_scale": 0.7,
        },
        "settings": {
            "maps": maps, "map_count": 84 if complete else 5, "complete_set": complete, "orientations": False,
            "repeats": 1, "seed": 11, "device": "cpu",
        },
        "summary": {
            "success": {"mean": mean, "standard_error": 0.0472, "wilson_95": [0.648, 0.83], "episodes": 84},
            "time_to_completion_s": {"mean": 15.617},
            "interaction_force": {"mean": 0.05004},
            "planning_ms_per_call": {"p50": 22.408},
        },
    }  # fmt: skip


@pytest.fixture
def run(tmp_path) -> Path:
    """A training run with one checkpoint, as LeRobot writes it."""
    folder = tmp_path / "training" / "checkpoints" / "last" / "pretrained_model"
    folder.mkdir(parents=True)
    (folder / "model.safetensors").write_bytes(WEIGHTS)
    (folder / "config.json").write_text(
        json.dumps({"type": "copolicy", "preset": "small", "horizon": 12}), encoding="utf-8"
    )
    training = {
        "dataset": {"repo_id": "lab/table", "root": str(tmp_path / "gone"), "episodes": [0, 2]},
        "steps": 2500, "batch_size": 512, "seed": 7, "optimizer": {"type": "adamw", "lr": 0.001},
        "scheduler": {"type": "copolicy_cosine", "num_warmup_steps": None, "final_lr_fraction": 0.01},
    }  # fmt: skip
    (folder / "train_config.json").write_text(json.dumps(training), encoding="utf-8")
    return tmp_path / "training"


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Path:
    """Four episodes of simulated pairs."""
    folder = tmp_path_factory.mktemp("model_card")
    simulated(folder / "raw", 4, 3)
    root = folder / "table"
    flags = ["--out", str(root), "--repo-id", "lab/table", "--license", "cc0-1.0"]
    assert convert(["mcap", str(folder / "raw"), *flags]) == 0
    return root


def _write(path: Path, value: dict) -> str:
    path.write_text(json.dumps(value), encoding="utf-8")
    return str(path)


def _card(run: Path) -> Path:
    return run / "checkpoints" / "last" / "pretrained_model" / "README.md"


def test_a_card_states_what_training_and_evaluation_wrote(run, dataset, tmp_path, capsys):
    holdout = _write(tmp_path / "holdout.json", _evaluation())
    unseen = _write(tmp_path / "unseen.json", _evaluation("unseen", 0.5, complete=False))
    flags = ["--dataset", str(dataset), "--repo-id", "lab/carrier", "--license", "apache-2.0", "--json"]
    assert main(["model", str(run), "--eval", holdout, "--eval", unseen, *flags]) == 0
    assert json.loads(capsys.readouterr().out)["trained_on"] == {"simulated": 4}
    card = ModelCard.load(_card(run))
    text = card.text
    assert (
        "| coplan | holdout | ddim, 10 steps, noise x 0.7 | 75.0 ± 4.7 | 64.8 to 83.0 | 84 | 11 | 15.62 | 0.05004 |"
        in text
    )
    assert "| coplan | unseen, first 5 | ddim, 10 steps, noise x 0.7 | 50.0 ± 4.7 |" in text
    assert "Only a part of the maps of unseen was evaluated." in text
    assert "**Co-planning in simulation: no person took part.**" in text
    assert "**No person took part.** Two scripted agents" in text
    assert "- Data set: `lab/table`\n- Source: simulated (4)\n- Episodes used: 2 of 4 (50.0 %)" in text
    assert "| training `seed` | 7 |" in text
    assert "| optimizer `lr` | 0.001 |" in text
    assert "| scheduler `type` | copolicy_cosine |\n| scheduler `final_lr_fraction` | 0.01 |" in text
    assert "| parameters | 1,132,464 |" in text
    assert f"`{hashlib.sha256(WEIGHTS).hexdigest()}`" in text
    assert str(tmp_path) not in text


def test_the_hub_reads_results_from_the_model_index(run, dataset, tmp_path):
    holdout = _write(tmp_path / "holdout.json", _evaluation())
    flags = ["--dataset", str(dataset), "--repo-id", "lab/carrier"]
    assert main(["model", str(run), "--eval", holdout, *flags]) == 0
    card = ModelCard.load(_card(run))
    (result,) = card.data.to_dict()["model-index"][0]["results"]
    (metric,) = result["metrics"]
    assert (metric["type"], metric["value"], metric["args"]["episodes"]) == ("success_rate", 0.75, 84)
    assert result["task"]["name"] == "table carrying, coplan (simulation)"
    assert result["dataset"]["type"] == "copolicy-maps-holdout"
    metadata = yaml.safe_load(card.content.split("---")[1])
    assert metadata["model-index"][0]["name"] == "carrier"
    assert metadata["datasets"] == ["lab/table"]
    assert metadata["library_name"] == "lerobot"
    assert "trained-on-simulated" in metadata["tags"]
    assert "license" not in metadata


@pytest.fixture
def exported(run) -> Path:
    """The folder of a policy that was exported: a recipe instead of the training's configuration, and results."""
    folder = run / "checkpoints" / "last" / "pretrained_model"
    (folder / "train_config.json").unlink()
    config = {"type": "copolicy", "n_obs_steps": 3, "horizon": 12, "n_action_steps": 8, "past_human_action": True}
    (folder / "config.json").write_text(json.dumps(config | {"ema": False}), encoding="utf-8")
    recipe = {
        "weights": {"exported_from": "f" * 64, "averaged": True},
        "training": {"steps": 900, "batch_size": 64, "seed": 3, "samples": 57_600},
        "dataset": {
            "repo_id": "local/pairs", "episodes": 20, "episodes_used": 18, "frames": 3400, "fps": 10,
            "source": {"simulated": 18}, "map_set": {"training": 18}, "license": {"cc0-1.0": 18},
            "pair_id": {"S01": 18},
        },
        "commands": ["copolicy-collect simulate --episodes 20", "copolicy-train --steps=900"],
    }  # fmt: skip
    (folder / "recipe.json").write_text(json.dumps(recipe), encoding="utf-8")
    holdout = _evaluation()
    holdout["policy"]["weights_sha256"] = "f" * 64  # of the checkpoint that it was exported from
    partner = _evaluation("unseen", 0.9)
    partner |= {"study": "partner", "label": "with SIMULATED partners, no person took part", "name": "CoDP-H"}
    partner["settings"] |= {"configurations": 60, "actions_per_plan": 1}
    partner["summary"] |= {"robot_share": 0.48, "by_partner": {"slow": {"success": {"mean": 0.95}}}}
    partner["baselines"] = [{"name": "passive", "summary": {**_evaluation()["summary"], "robot_share": 0.0}}]
    (folder / "eval.json").write_text(json.dumps({"evaluations": [holdout, partner]}), encoding="utf-8")
    return folder


def test_the_card_of_an_exported_policy_comes_from_its_own_files(exported, capsys):
    assert main(["model", str(exported), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["evaluations"], summary["trained_on"]) == (2, {"simulated": 18})
    text = (exported / "README.md").read_text(encoding="utf-8")
    assert (
        "Input: the last 3 frames at 10 Hz of the table's pose and velocity, the map (start, goal, up to three " in text
    )
    assert "Training data: **No person took part.**" in text
    assert "- Data set: `local/pairs` (a local name, not one on the Hub)" in text
    assert "- Episodes used: 18 of 20 (90.0 %)\n- Frames: 3,400 at 10 Hz\n- Pairs: S01 (18)\n" in text
    assert "| training `steps` | 900 |" in text
    assert "| weights | moving average over the training only |" in text
    assert "`ema`" not in text
    assert "```bash\ncopolicy-collect simulate --episodes 20\ncopolicy-train --steps=900\n```" in text
    assert "hf download" not in text
    assert "trained-on-simulated" in text


def test_a_study_with_partners_has_a_table_of_its_own(exported):
    assert main(["model", str(exported)]) == 0
    text = (exported / "README.md").read_text(encoding="utf-8")
    assert "**With SIMULATED partners, no person took part.**" in text
    assert "With simulated partners on 60 starts of the unseen maps, 1 action(s) per chunk, ddim, 10 steps" in text
    assert "| CoDP-H | 90.0 ± 4.7 | 64.8 to 83.0 | 84 | 15.62 | 0.05004 | 0.48 | 95.0 |" in text
    assert "| passive | 75.0 ± 4.7 | 64.8 to 83.0 | 84 | 15.62 | 0.05004 | 0 | - |" in text
    assert "The partners of the study are also simulated" in text


def test_the_packaged_model_is_named_pretrained(exported, tmp_path):
    folder = exported.rename(tmp_path / "pretrained")
    assert main(["model", str(folder)]) == 0
    text = (folder / "README.md").read_text(encoding="utf-8")
    assert "copolicy-collect play --players keyboard policy:pretrained\n" in text
    assert "copolicy-eval coplan --policy pretrained --maps holdout --out eval.json\n" in text
    assert "`copolicy-train pretrained` prints its folder" in text


def test_what_is_not_at_hand_is_not_stated(run):
    assert main(["model", str(run)]) == 0
    text = _card(run).read_text(encoding="utf-8")
    assert "**Source of the training data: not stated.**" in text
    assert "- Source: not stated\n- Episodes used: 2\n" in text
    assert "Not evaluated: no `eval.json` was given." in text
    assert "model-index" not in text


def test_an_evaluation_of_other_weights_is_refused(run, tmp_path, capsys):
    evaluation = _evaluation()
    evaluation["policy"]["weights_sha256"] = "0" * 64
    path = _write(tmp_path / "eval.json", evaluation)
    assert main(["model", str(run), "--eval", path]) == 2
    digest = hashlib.sha256(WEIGHTS).hexdigest()[:12]
    assert capsys.readouterr().err == (
        f"copolicy-cards: {path}: expected an evaluation of pretrained_model (weights {digest}), "
        "found one of weights 000000000000\n"
    )
    assert not _card(run).exists()


@pytest.mark.parametrize(
    ("content", "found"),
    [
        ({"study": "coplan"}, "expected a result of copolicy-eval, found object missing required field `label`"),
        ([1], "expected a result of copolicy-eval, found a JSON list"),
        (None, "expected a result of copolicy-eval, found no such file"),
    ],
)
def test_what_is_no_evaluation_is_named(run, tmp_path, capsys, content, found):
    path = tmp_path / "eval.json"
    if content is not None:
        path.write_text(json.dumps(content), encoding="utf-8")
    assert main(["model", str(run), "--eval", str(path)]) == 2
    assert capsys.readouterr().err == f"copolicy-cards: {path}: {found}\n"


def test_a_folder_that_is_no_checkpoint_is_named(tmp_path, capsys):
    assert main(["model", str(tmp_path)]) == 2
    assert capsys.readouterr().err == (
        f"copolicy-cards: {tmp_path}: expected a checkpoint folder with config.json and model.safetensors, found none\n"
    )


def test_a_card_is_overwritten_on_request_only(run, capsys):
    _card(run).write_text("written by hand", encoding="utf-8")
    assert main(["model", str(run)]) == 2
    assert "nothing was overwritten" in capsys.readouterr().err
    assert _card(run).read_text(encoding="utf-8") == "written by hand"
    assert main(["model", str(run), "--overwrite"]) == 0
    assert _card(run).read_text(encoding="utf-8").startswith("---\n")
