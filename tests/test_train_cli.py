"""`copolicy-train`: the same training as `lerobot-train`, from memory, with errors of one line."""

import json
import logging
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch
from lerobot.datasets import EpisodeAwareSampler, LeRobotDataset
from safetensors.torch import load_file
from torch.utils.data import DataLoader, Subset, default_collate

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, RunError
from copolicy.dataset.features import FEATURES, STATE, TASK
from copolicy.train.cli import main, with_defaults
from copolicy.train.epoch_order import WholeEpochSampler
from copolicy.train.local_dataset import check_local_dataset, training_episodes
from copolicy.train.memory_dataset import MemoryDataset

LENGTHS = (14, 5, 20, 11, 17, 8)
WINDOWS = {
    **{key: [-0.2, -0.1, 0.0] for key in FEATURES if key.startswith("observation.")},
    "action": [frame / 10 for frame in range(-2, 10)],
}
SMALL = ["--policy.preset=small", "--policy.width=16", "--policy.n_layers=1", "--policy.device=cpu"]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    """A data set written with LeRobot's own writer; its second episode is marked as discarded."""
    root = tmp_path_factory.mktemp("data") / "table"
    dataset = LeRobotDataset.create("local/table", 10, FEATURES, root=root, use_videos=False, video_backend="pyav")
    random = np.random.default_rng(0)
    for length in LENGTHS:
        for frame in range(length):
            values = {
                key: random.uniform(-1, 1, feature["shape"]).astype(feature["dtype"])
                for key, feature in FEATURES.items()
                if feature["dtype"] == "float32"
            }
            last = np.array([frame == length - 1])
            dataset.add_frame({**values, "next.done": last, "next.success": last, "task": TASK})
        dataset.save_episode()
    dataset.finalize()
    mark_discarded(root, ())
    return root


@pytest.fixture
def copied(recorded, tmp_path) -> Path:
    return Path(shutil.copytree(recorded, tmp_path / "copied"))


@pytest.fixture(autouse=True)
def _logging_as_before():
    """LeRobot replaces the handlers of the root logger."""
    root = logging.getLogger()
    before = root.handlers[:], root.level
    yield
    root.handlers[:], root.level = before


def mark_discarded(root: Path, discarded) -> None:
    path = root / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    table = pq.read_table(path)
    if "discarded" in table.column_names:
        table = table.drop_columns("discarded")
    marks = pa.array([episode in discarded for episode in range(len(LENGTHS))])
    pq.write_table(table.append_column("discarded", marks), path)


def windows(root: Path, **settings) -> Any:
    return LeRobotDataset("local/table", root=root, delta_timestamps=WINDOWS, video_backend="pyav", **settings)


def flags(root: Path, output: Path, **more) -> list[str]:
    settings = {"batch_size": 8, "steps": 4, "save_freq": 2, "log_freq": 1, **more}
    return [
        f"--dataset.root={root}",
        f"--output_dir={output}",
        *SMALL,
        *(f"--{name}={value}" for name, value in settings.items()),
    ]


def lerobot_train(monkeypatch, arguments: list[str]) -> None:
    from lerobot.scripts import lerobot_train as script

    monkeypatch.setattr(sys, "argv", ["lerobot-train", *with_defaults(arguments)])
    script.main()


def weights(output: Path, step: int = 4) -> dict[str, torch.Tensor]:
    return load_file(output / "checkpoints" / f"{step:06d}" / "pretrained_model" / "model.safetensors")


def assert_same_batch(ours: dict, theirs: Any) -> None:
    assert list(ours) == list(theirs)
    for key, values in theirs.items():
        if isinstance(values, torch.Tensor):
            assert ours[key].dtype == values.dtype, key
            assert torch.equal(ours[key], values), key
        else:
            assert ours[key] == values, key


def assert_same_weights(ours: dict[str, torch.Tensor], theirs: dict[str, torch.Tensor]) -> None:
    assert ours.keys() == theirs.keys()
    for key, values in theirs.items():
        assert torch.equal(ours[key], values), key


@pytest.mark.parametrize("episodes", [None, [4, 1, 2]])
def test_batches_are_the_stock_loaders(recorded, episodes):
    stock = windows(recorded, episodes=episodes)
    memory = MemoryDataset(stock)
    assert (len(memory), memory.num_frames, memory.num_episodes) == (len(stock), stock.num_frames, stock.num_episodes)
    indices = torch.randperm(len(stock), generator=torch.Generator().manual_seed(0)).tolist()
    for order in (range(len(stock)), indices[:7]):
        assert_same_batch(
            next(iter(DataLoader(Subset(memory, list(order)), batch_size=len(order)))),
            default_collate([stock[index] for index in order]),
        )
    assert_same_batch(memory[3], stock[3])


def test_windows_are_padded_at_both_ends_of_an_episode(recorded):
    memory = MemoryDataset(windows(recorded))
    first, last = LENGTHS[0], LENGTHS[0] + LENGTHS[1] - 1
    batch = memory.window_batch([first, last])
    assert batch["action_is_pad"][0].tolist() == [True, True] + [False] * 5 + [True] * 5
    assert batch["action_is_pad"][1].tolist() == [False] * 3 + [True] * 9
    assert torch.equal(batch["action"][0, 0], batch["action"][0, 2])
    assert torch.equal(batch["action"][1, -1], batch["action"][1, 2])
    assert torch.equal(batch[STATE][0, 0], batch[STATE][0, 2])


@pytest.mark.parametrize("workers", [0, 1])
def test_a_batch_passes_the_loader_in_one_piece(recorded, workers):
    loader = DataLoader(MemoryDataset(windows(recorded)), batch_size=16, num_workers=workers)
    batch = next(iter(loader))
    assert batch["action"].shape == (16, 12, 4)
    assert batch["task"] == [TASK] * 16


def test_rows_out_of_order_are_refused(copied):
    path = copied / "data" / "chunk-000" / "file-000.parquet"
    table = pq.read_table(path)
    order = [*range(3), 4, 3, *range(5, len(table))]
    pq.write_table(table.take(order[len(table) // 2 :] + order[: len(table) // 2]), path)
    with pytest.raises(RunError, match="expected the rows of each episode together and in order"):
        MemoryDataset(windows(copied))


@pytest.mark.parametrize("shuffle", [True, False])
@pytest.mark.parametrize("episodes", [None, [0, 3]])
def test_order_is_the_stock_samplers(recorded, shuffle, episodes):
    dataset = windows(recorded, episodes=episodes)
    table = dataset.meta.episodes
    samplers = [
        kind(
            table["dataset_from_index"],
            table["dataset_to_index"],
            episode_indices_to_use=episodes,
            drop_n_last_frames=6,
            shuffle=shuffle,
            seed=7,
            absolute_to_relative_idx=dataset.absolute_to_relative_idx,
        )
        for kind in (WholeEpochSampler, EpisodeAwareSampler)
    ]
    assert list(samplers[0]) == list(samplers[1])
    for sampler in samplers:
        sampler.load_state_dict({"epoch": 3, "start_index": 5})
    assert list(samplers[0]) == list(samplers[1])


def test_training_is_lerobots_step_for_step(recorded, tmp_path, monkeypatch, capsys):
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    assert main(["--json", *flags(recorded, ours)]) == 0
    captured = capsys.readouterr()
    summary = json.loads(captured.out)
    assert summary["steps"] == 4
    assert Path(summary["checkpoint"]).samefile(ours / "checkpoints" / "000004" / "pretrained_model")
    assert "torchcodec" not in captured.err
    lerobot_train(monkeypatch, flags(recorded, theirs))
    curves = [[line.split("loss:")[1].split()[0] for line in text.splitlines() if "loss:" in line]
              for text in (captured.err, capsys.readouterr().err)]  # fmt: skip
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
def test_trains_with_evaluations_and_fine_tunes(recorded, tmp_path, capsys):
    environment = {"env.type": "table_carrying", "env.step_limit": 9, "env_eval_freq": 2, "eval.n_episodes": 1}
    assert main(flags(recorded, tmp_path / "first", steps=2, **environment)) == 0
    assert "'pc_success': 0.0" in capsys.readouterr().err
    checkpoint = tmp_path / "first" / "checkpoints" / "last" / "pretrained_model"
    tuned = [argument for argument in flags(recorded, tmp_path / "tuned", steps=1) if "policy." not in argument]
    assert main([f"--policy.path={checkpoint}", "--policy.device=cpu", "--policy.n_action_steps=1", *tuned]) == 0
    config = json.loads((tmp_path / "tuned" / "checkpoints" / "last" / "pretrained_model" / "config.json").read_text())
    assert (config["width"], config["n_action_steps"], config["push_to_hub"]) == (16, 1, False)


def test_discarded_episodes_are_left_out_and_recorded(copied, tmp_path, capsys):
    mark_discarded(copied, (1, 4))
    assert main(flags(copied, tmp_path / "out", steps=1)) == 0
    assert "Leaving out 2 discarded of 6 episodes: [1, 4]" in capsys.readouterr().err
    config = json.loads(
        (tmp_path / "out" / "checkpoints" / "last" / "pretrained_model" / "train_config.json").read_text()
    )
    assert config["dataset"]["episodes"] == [0, 2, 3, 5]
    assert config["num_workers"] == 0
    assert config["policy"]["push_to_hub"] is False
    assert config["dataset"]["repo_id"] == "local/copied"


def test_held_out_episodes_are_evaluated_from_memory(recorded, tmp_path, capsys):
    more = {
        "steps": 2,
        "eval_steps": 2,
        "max_eval_samples": 8,
        "dataset.eval_split": 0.3,
        "dataset.episodes": "[0,2,4]",
    }
    assert main(flags(recorded, tmp_path / "out", **more)) == 0
    assert "eval_loss=" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("episodes", "discarded", "expected"),
    [
        (None, [], None),
        (None, [False] * 4, None),
        (None, [False, True, False, False], [0, 2, 3]),
        ([3, 1], [False, True, False, False], [3]),
        ([3, 2], [False, True, False, False], [3, 2]),
    ],
)
def test_episodes_to_train_on(episodes, discarded, expected):
    assert training_episodes(episodes, 4, discarded) == expected


def test_episodes_that_are_not_there_or_all_discarded():
    with pytest.raises(InvalidValueError, match=r"^dataset.episodes: expected 0 to 3, found 9$"):
        training_episodes([1, 9], 4, [])
    with pytest.raises(RunError, match=r"^dataset.episodes: all of the 2 episodes to train on are marked"):
        training_episodes([0, 1], 4, [True, True, False, False])


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


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (shutil.rmtree, "{root}: expected the folder of a LeRobot v3 data set, found no such folder"),
        (
            lambda root: (root / "meta" / "info.json").unlink(),
            "{root}/meta/info.json: expected a LeRobot v3 data set, found no such file",
        ),
        (
            lambda root: (root / "meta" / "info.json").write_text("{"),
            "{root}/meta/info.json: expected LeRobot's data set information, found JSONDecodeError",
        ),
        (
            lambda root: (root / "meta" / "info.json").write_text(
                '{"codebase_version": "v2.1", "total_frames": 1, "total_episodes": 1}'
            ),
            "{root}/meta/info.json: expected LeRobot data set format v3, found v2.1",
        ),
        (
            lambda root: truncate(root / "data" / "chunk-000" / "file-000.parquet"),
            "{root}/data/chunk-000/file-000.parquet: expected a complete Parquet file, found Parquet magic bytes not",
        ),
        (
            lambda root: (root / "data" / "chunk-000" / "file-000.parquet").unlink(),
            "{root}/data: expected 75 rows, as meta/info.json says, found 0",
        ),
        (
            lambda root: shutil.rmtree(root / "meta" / "episodes"),
            "{root}/meta/episodes: expected 6 rows, as meta/info.json says, found 0",
        ),
        (
            lambda root: (root / "meta" / "tasks.parquet").unlink(),
            "{root}/meta/tasks.parquet: expected part of a LeRobot v3 data set, found no such file",
        ),
    ],
)
def test_a_damaged_data_set_is_named_and_not_looked_for_on_the_hub(copied, damage, message):
    check_local_dataset(copied)
    damage(copied)
    with pytest.raises(FileFormatError) as caught:
        check_local_dataset(copied)
    assert str(caught.value).startswith(message.format(root=copied))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--dataset.root={tmp}/nothing"], "{tmp}/nothing: expected the folder of a LeRobot v3 data set"),
        (["--dataset.root={data}", "--nonsense=1"], "unrecognized arguments: --nonsense=1"),
        (["--dataset.root={data}", "--steps=two"], "`steps`: Couldn't parse 'two' into an int"),
        (["--dataset.root={data}", "--policy.preset=big"], "unknown preset 'big'; available: default, paper, small"),
        (["--dataset.root={data}", "--policy.n_action_steps=11"], "n_action_steps: expected 1 to 10"),
        (["--dataset.root={data}", "--output_dir={tmp}"], "{tmp}: expected a path that does not exist yet"),
        (["--dataset.root={data}", "--policy.push_to_hub=true"], "'repo_id' argument missing"),
        (["--dataset.root={data}", "--policy.path={tmp}/a"], "{tmp}/a: expected a file or folder for --policy.path"),
        (["--config_path={tmp}/c.json", "--resume=true"], "{tmp}/c.json: expected a file or folder for --config_path"),
        ([], "Missing required field(s) `dataset`"),
    ],
)
def test_wrong_calls_end_with_one_line_and_status_2(recorded, tmp_path, capsys, arguments, message):
    places = {"tmp": tmp_path, "data": recorded}
    assert main([argument.format(**places) for argument in arguments]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith("copolicy-train: ")
    assert message.format(**places) in line
    assert not (tmp_path / "nothing").exists()


def test_a_failing_run_ends_with_status_1(copied, tmp_path, capsys):
    mark_discarded(copied, range(len(LENGTHS)))
    assert main(flags(copied, tmp_path / "out")) == 1
    assert "all of the 6 episodes to train on are marked as discarded" in capsys.readouterr().err.splitlines()[-1]


def test_an_error_inside_lerobot_is_one_line_too_unless_debugging(recorded, tmp_path, capsys):
    arguments = flags(recorded, tmp_path / "out", drop="x")
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
