"""Excluded episodes are trained on by nobody who can see that they are excluded; a resumed run keeps its own."""

import json
import logging
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch
from lerobot.datasets import LeRobotDatasetMetadata
from training_table import flags, lerobot_train, mark_discarded, windows

from copolicy.dataset.exceptions import RunError
from copolicy.train.cli import main
from copolicy.train.episode_choice import resumed_episodes, selected_episodes
from lerobot_policy_copolicy.copolicy.configuration_copolicy import CopolicyConfig
from lerobot_policy_copolicy.copolicy.modeling_copolicy import CopolicyPolicy
from lerobot_policy_copolicy.pair_policy.training_data import prepare_training


def _meta(root: Path):
    return LeRobotDatasetMetadata("local/table", root)


def _settings(output: Path, step: int) -> dict:
    path = output / "checkpoints" / f"{step:06d}" / "pretrained_model" / "train_config.json"
    return json.loads(path.read_text(encoding="utf-8"))


def _strip(root: Path, mark: str) -> None:
    """What LeRobot's delete_episodes leaves of a data set of ours: a mark, and no episode column."""
    for path in (root / "meta" / "episodes").glob("*/*.parquet"):
        table = pq.ParquetFile(path).read()
        pq.write_table(table.drop_columns(["discarded"]), path)
    info = root / "meta" / "info.json"
    content = json.loads(info.read_text(encoding="utf-8"))
    if mark == "robot_type":
        content["robot_type"] = "copolicy_table"
    elif mark == "action":
        content["features"]["action"] |= {"hold": "mean", "record_hz": 30}
    elif mark == "file":
        (root / "meta" / "copolicy.json").write_text("{}", encoding="utf-8")
    info.write_text(json.dumps(content), encoding="utf-8")


def test_an_empty_mark_excludes_nothing_and_the_marks_are_read_by_episode(copied_table):
    for path in (copied_table / "meta" / "episodes").glob("*/*.parquet"):
        table = pq.ParquetFile(path).read().drop_columns(["discarded"])
        pq.write_table(table.append_column("discarded", pa.array([None, True, None, False, None, None])), path)
    assert selected_episodes(_meta(copied_table), None) == [0, 2, 3, 4, 5]
    assert selected_episodes(_meta(copied_table), [1, 5]) == [5]


@pytest.mark.parametrize("value", ["False", 0.5, [False]])
def test_a_mark_that_is_neither_true_nor_false_is_refused(copied_table, value):
    for path in (copied_table / "meta" / "episodes").glob("*/*.parquet"):
        table = pq.ParquetFile(path).read().drop_columns("discarded")
        pq.write_table(table.append_column("discarded", pa.array([value] * table.num_rows)), path)
    with pytest.raises(RunError, match="expected true or false in the episode column discarded, found "):
        selected_episodes(_meta(copied_table), None)


@pytest.mark.parametrize("mark", ["robot_type", "action", "file"])
def test_a_set_of_ours_without_its_columns_is_refused_unless_episodes_are_named(copied_table, mark):
    _strip(copied_table, mark)
    meta = _meta(copied_table)
    with pytest.raises(RunError) as caught:
        selected_episodes(meta, None)
    line = str(caught.value)
    assert "its episode columns were lost, as by LeRobot's delete_episodes; copolicy-dataset restores them" in line
    assert "--dataset.episodes=[0,1,...]" in line
    assert selected_episodes(meta, [0, 4]) == [0, 4]
    with pytest.raises(RunError, match="its episode columns were lost"):
        resumed_episodes(meta, [0, 4], [0, 4])  # numbers of a set that LeRobot has renumbered


def test_a_foreign_set_trains_as_it_is(copied_table):
    _strip(copied_table, "none")
    assert selected_episodes(_meta(copied_table), None) == list(range(6))


def test_copolicy_train_refuses_a_stripped_set_before_the_first_step(copied_table, tmp_path, capsys):
    _strip(copied_table, "robot_type")
    assert main(flags(copied_table, tmp_path / "out")) == 1
    assert "its episode columns were lost" in capsys.readouterr().err.splitlines()[-1]
    assert not (tmp_path / "out").exists()
    # Named, they are the user's choice, be it all of them.
    arguments = [*flags(copied_table, tmp_path / "out", steps=1), "--dataset.episodes=[0,1,2,3,4,5]"]
    assert main(arguments) == 0


def test_a_resumed_run_keeps_its_episodes_less_what_was_excluded_since(copied_table, tmp_path, capsys):
    output = tmp_path / "out"
    mark_discarded(copied_table, (2,))
    assert main(flags(copied_table, output, steps=2)) == 0
    assert _settings(output, 2)["dataset"]["episodes"] == [0, 1, 3, 4, 5]
    mark_discarded(copied_table, (4,))  # 2 was taken back since, which the run never saw
    capsys.readouterr()
    assert main([f"--config_path={output}", "--resume=true", "--steps=3"]) == 0
    assert "Resuming with 4 of the 5 episodes of the run; excluded since: [4]" in capsys.readouterr().err
    assert _settings(output, 3)["dataset"]["episodes"] == [0, 1, 3, 5]
    with_flag = [f"--config_path={output}", "--resume=true", "--steps=4", "--dataset.episodes=[4,5]"]
    assert main(with_flag) == 0
    assert "Resuming with 1 of the 2 episodes of --dataset.episodes; excluded since: [4]" in (capsys.readouterr().err)


def test_a_run_without_a_list_of_its_episodes_says_so(random_table, caplog):
    with caplog.at_level(logging.INFO):
        assert resumed_episodes(_meta(random_table), None, None) == list(range(6))
    assert "the checkpoint does not record those of the run" in caplog.text


def test_a_fresh_run_records_all_of_its_episodes(random_table, tmp_path):
    assert main(flags(random_table, tmp_path / "out", steps=1)) == 0
    assert _settings(tmp_path / "out", 1)["dataset"]["episodes"] == list(range(6))


def test_lerobot_train_refuses_excluded_episodes_and_says_which_flag_leaves_them_out(
    copied_table, tmp_path, monkeypatch
):
    mark_discarded(copied_table, (1, 4))
    output = tmp_path / "out"
    for more in ([], ["--dataset.episodes=[0,4]"], ["--dataset.eval_split=0.3"]):
        with pytest.raises(RunError) as caught:
            lerobot_train(monkeypatch, [*flags(copied_table, output), *more])
        assert "--dataset.episodes=[0,2,3,5]" in str(caught.value)
        assert not output.exists()
    lerobot_train(monkeypatch, [*flags(copied_table, output, steps=1), "--dataset.episodes=[0,2,3,5]"])
    mark_discarded(copied_table, (0,))
    resume = [f"--config_path={output}/checkpoints/last/pretrained_model/train_config.json", "--resume=true"]
    with pytest.raises(RunError, match=r"expected no excluded episode among those to train on, found \[0\]"):
        lerobot_train(monkeypatch, [*resume, "--steps=2"])


def test_lerobot_train_refuses_a_stripped_set(copied_table, tmp_path, monkeypatch):
    _strip(copied_table, "action")
    with pytest.raises(RunError, match="its episode columns were lost"):
        lerobot_train(monkeypatch, flags(copied_table, tmp_path / "out"))


def test_streaming_leaves_them_out_or_refuses(copied_table, tmp_path, monkeypatch):
    mark_discarded(copied_table, (1, 4))
    streamed = [*flags(copied_table, tmp_path / "out", steps=2, save_freq=2), "--dataset.streaming=true"]
    with pytest.raises(RunError, match="streamed data set yields every episode"):
        lerobot_train(monkeypatch, [*streamed, "--dataset.episodes=[0,2,3,5]"])
    assert main(streamed) == 0
    assert _settings(tmp_path / "out", 2)["dataset"]["episodes"] == [0, 2, 3, 5]


def _policy_for(meta) -> CopolicyPolicy:
    from small_policies import policy

    config = policy().config
    return CopolicyPolicy(config, dataset_meta=meta)


def test_a_loop_of_ones_own_is_stopped_at_an_excluded_frame(copied_table):
    mark_discarded(copied_table, (1,))
    policy = _policy_for(_meta(copied_table))  # nothing around it tells which episodes will come
    data = windows(copied_table)
    good, bad = (torch.utils.data.default_collate([data[row] for row in rows]) for rows in ((0, 3), (3, 15)))
    policy.train()
    policy.forward(good)
    with pytest.raises(RunError, match=r"expected no excluded episode in a batch, found \[1\]"):
        policy.forward(bad)
    policy.eval()
    policy.forward(bad)  # an evaluation is no training


def test_a_data_set_beside_the_policy_is_seen(copied_table):
    mark_discarded(copied_table, (1,))
    config = CopolicyConfig(device="cpu")
    data = windows(copied_table, episodes=[0, 2])
    assert prepare_training(config, data.meta) == frozenset()
    data = windows(copied_table, episodes=[0, 1])
    with pytest.raises(RunError, match=r"found \[1\]"):
        prepare_training(config, data.meta)
