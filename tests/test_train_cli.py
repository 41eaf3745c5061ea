"""`copolicy-train`: the same training as `lerobot-train`, from memory, with errors of one line."""

import json
import logging
import shutil
from pathlib import Path

import pytest
import torch
from training_table import (
    LENGTHS,
    assert_same_weights,
    flags,
    lerobot_train,
    losses,
    mark_discarded,
    weights,
)

from copolicy.dataset.exceptions import RunError
from copolicy.train.cli import main, with_defaults


@pytest.fixture(autouse=True)
def _logging_as_before():
    """LeRobot replaces the handlers of the root logger."""
    root = logging.getLogger()
    before = root.handlers[:], root.level
    yield
    root.handlers[:], root.level = before


def test_training_is_lerobots_step_for_step(random_table, tmp_path, monkeypatch, capsys):
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    assert main(["--json", *flags(random_table, ours)]) == 0
    captured = capsys.readouterr()
    summary = json.loads(captured.out)
    assert summary["steps"] == 4
    assert Path(summary["checkpoint"]).samefile(ours / "checkpoints" / "000004" / "pretrained_model")
    assert "torchcodec" not in captured.err
    lerobot_train(monkeypatch, flags(random_table, theirs))
    curves = [losses(text) for text in (captured.err, capsys.readouterr().err)]
    assert len(curves[0]) == 4
    assert curves[0] == curves[1]
    for step in (2, 4):
        assert_same_weights(weights(ours, step), weights(theirs, step))

    # Each resumes the other's run, from the same checkpoint to the same weights.
    resumed = []
    for name, run in (("ours", main), ("theirs", lambda arguments: lerobot_train(monkeypatch, arguments))):
        output = tmp_path / f"{name}_resumed"
        shutil.copytree(theirs if name == "ours" else ours, output, symlinks=True)
        checkpoint = output / "checkpoints" / "000002" / "pretrained_model" / "train_config.json"
        run([f"--config_path={checkpoint}", "--resume=true", f"--output_dir={output}"])
        resumed.append(weights(output))
    assert_same_weights(*resumed)
    assert not torch.equal(resumed[0]["denoiser.head.weight"], weights(ours, 2)["denoiser.head.weight"])


@pytest.mark.filterwarnings("ignore:pkg_resources is deprecated")  # from pygame, which draws the videos
def test_trains_with_evaluations_and_fine_tunes(random_table, tmp_path, capsys):
    environment = {"env.type": "table_carrying", "env.step_limit": 9, "env_eval_freq": 2, "eval.n_episodes": 1}
    assert main(flags(random_table, tmp_path / "first", steps=2, **environment)) == 0
    assert "'pc_success': 0.0" in capsys.readouterr().err
    checkpoint = tmp_path / "first" / "checkpoints" / "last" / "pretrained_model"
    tuned = [argument for argument in flags(random_table, tmp_path / "tuned", steps=1) if "policy." not in argument]
    assert main([f"--policy.path={checkpoint}", "--policy.device=cpu", "--policy.n_action_steps=1", *tuned]) == 0
    config = json.loads(
        (tmp_path / "tuned" / "checkpoints" / "last" / "pretrained_model" / "config.json").read_text(encoding="utf-8")
    )
    assert (config["width"], config["n_action_steps"], config["push_to_hub"]) == (16, 1, False)


def test_discarded_episodes_are_left_out_and_recorded(copied_table, tmp_path, capsys):
    mark_discarded(copied_table, (1, 4))
    assert main(flags(copied_table, tmp_path / "out", steps=1)) == 0
    assert "Leaving out 2 discarded of 6 episodes: [1, 4]" in capsys.readouterr().err
    config = json.loads(
        (tmp_path / "out" / "checkpoints" / "last" / "pretrained_model" / "train_config.json").read_text(
            encoding="utf-8"
        )
    )
    assert config["dataset"]["episodes"] == [0, 2, 3, 5]
    assert config["num_workers"] == 0
    assert config["policy"]["push_to_hub"] is False
    assert config["dataset"]["repo_id"] == "local/copied_table"


def test_held_out_episodes_are_evaluated_from_memory(random_table, tmp_path, capsys):
    more = {
        "steps": 2,
        "eval_steps": 2,
        "max_eval_samples": 8,
        "dataset.eval_split": 0.3,
        "dataset.episodes": "[0,2,4]",
    }
    assert main(flags(random_table, tmp_path / "out", **more)) == 0
    assert "eval_loss=" in capsys.readouterr().err


def test_defaults_do_not_override_what_is_given():
    assert with_defaults(["--dataset.root=somewhere/table"]) == [
        "--num_workers=0",
        "--policy.type=copolicy",
        "--policy.push_to_hub=false",
        "--dataset.repo_id=local/table",
        "--dataset.root=somewhere/table",
    ]
    given = ["--policy.path", "checkpoint", "--policy.push_to_hub=true", "--num_workers", "2", "--dataset.repo_id=me/t"]
    assert with_defaults(given) == given
    assert with_defaults(["--config_path=c.json", "--resume=true"])[0] == "--num_workers=0"
    assert len(with_defaults(["--config_path=c.json", "--resume=true"])) == 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--dataset.root={tmp}/nothing"], "{tmp}/nothing: expected the folder of a LeRobot v3 data set"),
        (["--dataset.root={data}", "--nonsense=1"], "unrecognized arguments: --nonsense=1"),
        (["--dataset.root={data}", "--steps=two"], "`steps`: Couldn't parse 'two' into an int"),
        (["--dataset.root={data}", "--policy.preset=big"], "unknown preset 'big'; available: cnn, cnn-inpainting, "),
        (["--dataset.root={data}", "--policy.n_action_steps=11"], "n_action_steps: expected 1 to 10"),
        (["--dataset.root={data}", "--output_dir={tmp}"], "{tmp}: expected a path that does not exist yet"),
        (["--dataset.root={data}", "--policy.push_to_hub=true"], "'repo_id' argument missing"),
        (["--dataset.root={data}", "--policy.path={tmp}/a"], "{tmp}/a: expected a file or folder for --policy.path"),
        (["--config_path={tmp}/c.json", "--resume=true"], "{tmp}/c.json: expected a file or folder for --config_path"),
        ([], "Missing required field(s) `dataset`"),
        (["--dataset.root={data}", "--steps=0"], "--steps: expected at least 1, found 0"),
        (["--dataset.root={data}", "--batch_size=-1"], "--batch_size: expected at least 1, found -1"),
        (["--dataset.root={data}", "--num_workers=-1"], "--num_workers: expected at least 0, found -1"),
        (["--dataset.root={data}", "--log_freq=-5"], "--log_freq: expected at least 0, found -5"),
        (["--dataset.root={data}", "--eval.n_episodes=0"], "--eval.n_episodes: expected at least 1, found 0"),
        (["--dataset.root={data}", "--seed=-1"], "--seed: expected 0 to 4294967295, found -1"),
        (["--dataset.root={data}", "--seed=4294967296"], "--seed: expected 0 to 4294967295, found 4294967296"),
        (["--dataset.root={data}", "--tolerance_s=nan"], "--tolerance_s: expected a number of at least 0, found nan"),
        (
            ["--dataset.root={data}", "--dataset.episodes=[]"],
            "--dataset.episodes: expected at least one episode, or no",
        ),
        (["--dataset.root={data}", "--policy.initial_noise_scale=-1"], "initial_noise_scale: expected zero or more"),
        (["--dataset.root={data}", "--policy.initial_noise_scale=nan"], "initial_noise_scale: expected zero or more"),
        (["--dataset.root={data}", "--policy.num_inference_steps=0"], "num_inference_steps: expected 1 to "),
        (["--dataset.root={data}", "--policy.width=0"], "width: expected at least 1, found 0"),
        (["--dataset.root={data}", "--policy.optimizer_lr=nan"], "optimizer_lr: expected at least 0, found nan"),
        (["--dataset.root={data}", "--policy.attention_dropout=1"], "attention_dropout: expected 0 or more and less"),
    ],
)
def test_wrong_calls_end_with_one_line_and_status_2(random_table, tmp_path, capsys, arguments, message):
    places = {"tmp": tmp_path, "data": random_table}
    assert main([argument.format(**places) for argument in arguments]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith("copolicy-train: ")
    assert message.format(**places) in line
    assert not list(tmp_path.iterdir())


def test_a_failing_run_ends_with_status_1(copied_table, tmp_path, capsys):
    mark_discarded(copied_table, range(len(LENGTHS)))
    assert main(flags(copied_table, tmp_path / "out")) == 1
    assert "all of the 6 episodes to train on are marked as discarded" in capsys.readouterr().err.splitlines()[-1]


def test_an_error_inside_lerobot_is_one_line_too_unless_debugging(random_table, tmp_path, capsys):
    arguments = flags(random_table, tmp_path / "out", drop="x")
    arguments[-1] = "--policy.drop_n_last_frames=100"
    assert main(arguments) == 1
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith("copolicy-train: training stopped: ValueError: No valid frames remain")
    with pytest.raises(RunError):
        main([*arguments[:1], f"--output_dir={tmp_path / 'other'}", *arguments[2:], "--debug"])


def test_help_has_an_example_and_the_policys_settings(capsys):
    assert main(["--help"]) == 0
    printed = capsys.readouterr().out
    assert "example:\n  copolicy-train --dataset.root=data/table --policy.preset=small" in printed
    assert "condition on the human's past action" in " ".join(printed.split())
