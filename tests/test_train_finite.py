"""What is not a finite number is refused before the first step, and ends a run at the step where it arises."""

import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch
from lerobot.datasets import LeRobotDatasetMetadata
from training_table import LENGTHS, flags, lerobot_train, mark_discarded, weights, write_table

from copolicy.dataset.exceptions import FileFormatError, RunError
from copolicy.train.cli import main
from copolicy.train.finite_data import NonFiniteError, NonFiniteLossError, non_finite_rows, require_finite_frames
from copolicy.train.finite_training import guarded_functions, link_last_checkpoint
from copolicy.train.finite_weights import non_finite_weight
from copolicy.train.memory_training import CheckedStream

EPISODE, FRAME = 2, 7
ROW = LENGTHS[0] + LENGTHS[1] + FRAME
ACT = ["--policy.type=act", "--policy.device=cpu", "--policy.push_to_hub=false", "--policy.dim_model=16"]


def spoil(root: Path, column: str, value, rows=(ROW,)) -> None:
    """Puts a value, into the second place where the column has several, into rows of a data set."""
    (path,) = (root / "data").glob("*/*.parquet")
    table = pq.read_table(path)
    values = table.column(column).to_pylist()
    for row in rows:
        values[row] = [values[row][0], value, *values[row][2:]] if isinstance(values[row], list) else value
    kind = table.schema.field(column).type
    place = table.schema.get_field_index(column)
    pq.write_table(table.set_column(place, table.schema.field(column), pa.array(values, kind)), path)


def other_policy(root: Path, output: Path, policy: list[str], **more) -> list[str]:
    """A short training of another policy than ours."""
    own = [flag for flag in flags(root, output, **more) if not flag.startswith("--policy.")]
    return [*own, *policy]


@pytest.mark.parametrize(
    ("column", "value", "found"),
    [
        ("action", float("nan"), "nan"),
        ("observation.state", float("-inf"), "-inf"),
        ("observation.environment_state", None, "an empty value"),
        ("observation.human_action", float("inf"), "inf"),
        ("next.reward", float("nan"), "nan"),
        ("next.reward", None, "an empty value"),
        ("next.done", None, "an empty value"),
        ("timestamp", float("nan"), "nan"),
    ],
)
def test_a_value_that_cannot_be_trained_on_is_named_by_column_episode_and_frame(copied_table, column, value, found):
    meta = LeRobotDatasetMetadata("local/table", copied_table)
    require_finite_frames(copied_table, None, meta.features)
    spoil(copied_table, column, value)
    with pytest.raises(NonFiniteError) as caught:
        require_finite_frames(copied_table, None, meta.features)
    line = str(caught.value)
    assert f"found {found} in {column} of episode {EPISODE}, frame {FRAME};" in line
    assert "\n" not in line
    require_finite_frames(copied_table, set(range(6)) - {EPISODE}, meta.features)


def test_more_of_them_are_counted_and_an_empty_row_is_found(copied_table):
    meta = LeRobotDatasetMetadata("local/table", copied_table)
    spoil(copied_table, "action", float("nan"), rows=(ROW, ROW + 1, 0))
    spoil(copied_table, "observation.state", float("nan"), rows=(0,))
    with pytest.raises(NonFiniteError, match=r"of episode 0, frame 0 \(and such values in 2 more frames, of .* 0, 2\)"):
        require_finite_frames(copied_table, None, meta.features)


@pytest.mark.parametrize("kind", [pa.list_(pa.float32()), pa.list_(pa.float32(), 2), pa.large_list(pa.float64())])
def test_rows_of_lists(kind):
    column = pa.array([[0, 1], [float("nan"), 1], None, [1, None], [2, 3]], kind)
    assert non_finite_rows(column).tolist() == [False, True, True, True, False]
    assert non_finite_rows(column.slice(3)).tolist() == [True, False]


def test_a_number_that_float32_cannot_hold_is_infinite_in_training():
    assert non_finite_rows(pa.array([1.0, 1e300], pa.float64())).tolist() == [False, True]


def test_a_foreign_column_may_hold_what_it_likes(copied_table):
    meta = LeRobotDatasetMetadata("local/table", copied_table)
    (path,) = (copied_table / "data").glob("*/*.parquet")
    table = pq.read_table(path)
    pq.write_table(table.append_column("force.z", pa.array([float("nan")] * len(table))), path)
    require_finite_frames(copied_table, None, {**meta.features, "force.z": {"dtype": "float64", "shape": (1,)}})


@pytest.mark.parametrize("policy", ["ours", "act", "streamed"])
def test_copolicy_train_refuses_before_the_first_step(copied_table, tmp_path, capsys, policy):
    spoil(copied_table, "action", float("nan"))
    output = tmp_path / "out"
    arguments = flags(copied_table, output)
    if policy == "act":
        arguments = other_policy(copied_table, output, ACT)
    if policy == "streamed":
        arguments.append("--dataset.streaming=true")
    assert main(arguments) == 1
    error = capsys.readouterr().err
    assert f"found nan in action of episode {EPISODE}, frame {FRAME}" in error.splitlines()[-1]
    assert "loss:" not in error
    assert not output.exists()


def test_lerobot_train_refuses_too(copied_table, tmp_path, monkeypatch, capsys):
    spoil(copied_table, "observation.state", float("nan"))
    with pytest.raises(NonFiniteError, match=f"nan in observation.state of episode {EPISODE}, frame {FRAME}"):
        lerobot_train(monkeypatch, flags(copied_table, tmp_path / "out"))
    assert "loss:" not in capsys.readouterr().err
    # An episode that is not trained on does no harm.
    lerobot_train(monkeypatch, [*flags(copied_table, tmp_path / "out", steps=1), "--dataset.episodes=[0,1,3]"])
    assert weights(tmp_path / "out", 1)


@pytest.mark.parametrize(("column", "kind"), [("action", "std"), ("index", "max")])
def test_statistics_that_are_not_finite_are_refused(copied_table, tmp_path, capsys, column, kind):
    path = copied_table / "meta" / "stats.json"
    stats = json.loads(path.read_text(encoding="utf-8"))
    stats[column][kind][-1] = None
    path.write_text(json.dumps(stats), encoding="utf-8")
    assert main(flags(copied_table, tmp_path / "out")) == 1
    line = capsys.readouterr().err.splitlines()[-1]
    assert (
        f"{path}: expected finite numbers, found {kind} of {column}: an empty value" in line
        or f"{kind} of {column}: nan" in line
    )
    assert not (tmp_path / "out").exists()


def test_an_excluded_episode_may_hold_nan_and_its_statistics_do_no_harm(tmp_path, capsys):
    root = write_table(tmp_path / "table")
    spoil(root, "action", float("nan"))
    mark_discarded(root, (EPISODE,))
    path = root / "meta" / "stats.json"
    stats = json.loads(path.read_text(encoding="utf-8"))
    clean = stats["action"]["mean"]
    stats["action"]["mean"] = [float("nan")] * 4
    path.write_text(json.dumps(stats), encoding="utf-8")
    output = tmp_path / "out"
    assert main(other_policy(root, output, ACT, steps=1, save_freq=1)) == 0, capsys.readouterr().err
    saved = next((output / "checkpoints" / "000001" / "pretrained_model").glob("policy_preprocessor_*.safetensors"))
    from safetensors.torch import load_file

    mean = load_file(saved)["action.mean"]
    assert torch.isfinite(mean).all()
    assert mean.tolist() != pytest.approx(clean, abs=1e-6)  # that of the other five episodes


def _diverging(root: Path, output: Path, policy: str, rate: str) -> list[str]:
    """Steps of the size of the rate: the first of ACT, the second of ours, whose rate rises from zero."""
    if policy != "ours":
        return other_policy(root, output, [*ACT, f"--policy.optimizer_lr={rate}"], save_freq=1)
    more = [f"--policy.optimizer_lr={rate}", "--policy.scheduler_warmup_steps=1", "--policy.optimizer_weight_decay=0"]
    return [*flags(root, output, save_freq=2), *more]


@pytest.mark.parametrize("policy", ["ours", "without average", "act"])
def test_a_loss_that_is_not_finite_ends_the_run_at_its_step(random_table, tmp_path, capsys, policy):
    output = tmp_path / "out"
    arguments = _diverging(random_table, output, "act" if policy == "act" else "ours", "1e37")
    if policy == "without average":
        arguments.append("--policy.ema=false")
    assert main(arguments) == 1
    error = capsys.readouterr().err
    line = error.splitlines()[-1]
    step = 2 if policy == "act" else 3
    assert line.startswith(f"copolicy-train: training stopped at step {step}: expected a finite ")
    assert line.endswith(f"; the last checkpoint is {output / 'checkpoints' / 'last'}")
    assert "End of training" not in error
    checkpoints = output / "checkpoints"
    assert sorted(path.name for path in checkpoints.iterdir()) == [f"{step - 1:06d}", "last"]
    assert (checkpoints / "last").resolve().name == f"{step - 1:06d}"
    assert non_finite_weight(weights(output, step - 1)) is None


def test_weights_that_are_not_finite_are_not_saved(random_table, tmp_path, capsys):
    output = tmp_path / "out"
    assert main(_diverging(random_table, output, "ours", "1e39")) == 1
    line = capsys.readouterr().err.splitlines()[-1]
    assert "training stopped at step 2: expected finite weights, found" in line
    assert line.endswith("; no checkpoint was written")
    assert not output.exists()


def test_a_resumed_run_says_the_step_of_the_whole_run(random_table, tmp_path, capsys):
    output = tmp_path / "out"
    assert main(flags(random_table, output, steps=2)) == 0
    # A state that no good run leaves behind: steps of this size throw the weights far off.
    state = output / "checkpoints" / "000002" / "training_state"
    for path, name in (("optimizer_param_groups.json", "lr"), ("scheduler_state.json", "base_lrs")):
        text = (state / path).read_text(encoding="utf-8")
        content = json.loads(text)
        if name == "lr":
            content = [{**group, "lr": 1e37, "initial_lr": 1e37} for group in content]
        else:
            content["base_lrs"] = [1e37 for _ in content["base_lrs"]]
        (state / path).write_text(json.dumps(content), encoding="utf-8")
    more = ["--resume=true", "--steps=6", "--save_freq=1", "--policy.ema=false"]
    assert main([f"--config_path={output}", *more]) == 1
    line = capsys.readouterr().err.splitlines()[-1]
    assert "training stopped at step 4: expected a finite" in line
    assert (output / "checkpoints" / "last").resolve().name == "000003"


def test_lerobot_train_stops_at_such_a_loss_and_keeps_the_checkpoint_before(random_table, tmp_path, monkeypatch):
    output = tmp_path / "out"
    with pytest.raises(
        NonFiniteLossError, match=r"^training stopped at step 3: expected a finite loss, found (nan|inf)"
    ):
        lerobot_train(monkeypatch, _diverging(random_table, output, "ours", "1e37"))
    assert (output / "checkpoints" / "last").resolve().name == "000002"
    with pytest.raises(NonFiniteError, match="expected finite weights to save, found"):
        lerobot_train(monkeypatch, _diverging(random_table, tmp_path / "other", "ours", "1e39"))
    assert not (tmp_path / "other" / "checkpoints" / "last").exists()


def test_a_checkpoint_with_nan_is_no_start(random_table, tmp_path, capsys):
    from safetensors.torch import load_file, save_file

    output = tmp_path / "out"
    assert main(flags(random_table, output, steps=1)) == 0
    path = output / "checkpoints" / "000001" / "pretrained_model" / "model.safetensors"
    state = load_file(path)
    state["denoiser.head.weight"][0, 0] = float("nan")
    save_file(state, path)
    assert main([f"--config_path={output}", "--resume=true", "--steps=2"]) == 2
    assert "expected finite weights to start from, found nan in denoiser.head.weight" in capsys.readouterr().err
    from copolicy.train.checkpoint import Checkpoint

    with pytest.raises(
        FileFormatError, match=r"expected finite weights, found nan or infinity in denoiser.head.weight"
    ):
        Checkpoint(output)


def test_the_stream_passes_over_other_episodes_and_stops_at_nan(copied_table):
    def stream(episodes):
        data = CheckedStream("local/table", copied_table, episodes=episodes, buffer_size=4, max_num_shards=1)
        return sorted({int(sample["episode_index"]) for sample in data})

    assert stream(None) == list(range(6))
    assert stream([4, 1]) == [1, 4]
    spoil(copied_table, "action", float("nan"))
    assert stream([4, 1]) == [1, 4]
    with pytest.raises(NonFiniteError, match=f"found others in action of episode {EPISODE}, around frame {FRAME}"):
        stream(None)


def _tracker(loss: float, gradient: float):
    return SimpleNamespace(steps=6, loss=SimpleNamespace(val=loss), grad_norm=SimpleNamespace(val=gradient))


@pytest.mark.parametrize(
    ("loss", "gradient", "scaler", "stopped"),
    [
        (1.0, 1.0, None, None),
        (float("inf"), 1.0, None, "loss, found inf"),
        (1.0, float("nan"), None, "gradient, found nan"),  # the loss of another process
        (1.0, float("inf"), object(), None),  # float16 leaves such a step out
    ],
)
def test_loss_and_gradient_are_looked_at_after_each_step(tmp_path, loss, gradient, scaler, stopped):
    names = ("update_policy", "save_checkpoint", "update_last_checkpoint", "make_policy")
    functions = dict.fromkeys(names, lambda *_, **__: "done")
    update = guarded_functions(SimpleNamespace(output_dir=tmp_path), functions)["update_policy"]  # pyright: ignore[reportArgumentType]
    arguments = {"accelerator": SimpleNamespace(scaler=scaler)}
    if stopped is None:
        assert update(_tracker(loss, gradient), None, **arguments) == "done"
        return
    with pytest.raises(RunError, match=f"^training stopped at step 7: expected a finite {stopped}; no checkpoint was"):
        update(_tracker(loss, gradient), None, **arguments)


@pytest.mark.parametrize("gathered", [True, False])
def test_any_policy_is_looked_at_before_it_is_saved(tmp_path, gathered):
    saved = []
    names = ("update_policy", "update_last_checkpoint", "make_policy")
    functions = {**dict.fromkeys(names, lambda *_, **__: None), "save_checkpoint": lambda **call: saved.append(call)}
    save = guarded_functions(SimpleNamespace(output_dir=tmp_path), functions)["save_checkpoint"]  # pyright: ignore[reportArgumentType]
    policy = torch.nn.Linear(2, 2)
    save(checkpoint_dir=tmp_path / "000001", step=1, policy=policy)
    assert len(saved) == 1
    state = {name: values.clone() for name, values in policy.state_dict().items()}
    state["bias"][1] = float("-inf")
    more = {"model_state_dict": state} if gathered else {}
    if not gathered:
        policy.load_state_dict(state)
    with pytest.raises(
        NonFiniteError, match=r"^training stopped at step 2: expected finite weights, found -inf in bias"
    ):
        save(checkpoint_dir=tmp_path / "000002", step=2, policy=policy, **more)
    assert len(saved) == 1


@pytest.mark.parametrize("make", [Path.mkdir, Path.touch])
def test_what_is_no_link_makes_room_for_one(tmp_path, make):
    from lerobot.common.train_utils import update_last_checkpoint

    new = tmp_path / "000004"
    new.mkdir()
    make(tmp_path / "last")
    link_last_checkpoint(new, update_last_checkpoint)
    assert (tmp_path / "last").resolve() == new.resolve()
    assert (tmp_path / "last-copied-1").exists()


def test_where_no_link_can_be_made_there_is_none(tmp_path):
    def refused(_):
        raise PermissionError(1, "Operation not permitted")

    link_last_checkpoint(tmp_path / "000004", refused)
    assert not (tmp_path / "last").exists()


def test_a_run_copied_without_links_is_resumed_from_its_highest_number(random_table, tmp_path, capsys):
    output = tmp_path / "out"
    assert main(flags(random_table, output, steps=4, save_freq=2)) == 0
    copied = Path(shutil.copytree(output, tmp_path / "copied"))  # follows links, as `cp -L` does
    assert not (copied / "checkpoints" / "last").is_symlink()
    named = copied / "checkpoints" / "last" / "pretrained_model" / "train_config.json"
    assert main([f"--config_path={named}", "--resume=true", "--steps=5", f"--output_dir={copied}"]) == 0
    assert (copied / "checkpoints" / "last").resolve().name == "000005"
    (output / "checkpoints" / "last").unlink()
    capsys.readouterr()
    assert main([f"--config_path={output}", "--resume=true", "--steps=5", "--json"]) == 0
    captured = capsys.readouterr()
    assert f"the newest checkpoint is {output / 'checkpoints' / '000004'}" in captured.err
    assert Path(json.loads(captured.out)["checkpoint"]).is_dir()
    tuned = [flag for flag in flags(random_table, tmp_path / "tuned", steps=1) if "policy." not in flag]
    assert main([f"--policy.path={copied}", "--policy.device=cpu", *tuned]) == 0
    assert np.isfinite(float(weights(tmp_path / "tuned", 1)["denoiser.head.weight"].sum()))
