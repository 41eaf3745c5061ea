"""`copolicy-train --split`: which episodes it chooses, and what each checkpoint records of them."""

import json
from pathlib import Path

import pytest
from lerobot.datasets import LeRobotDatasetMetadata
from training_table import flags

from copolicy.dataset.exceptions import CopolicyError
from copolicy.dataset.versions.content import read_content
from copolicy.train.cli import main
from copolicy.train.pair_split import PairSplit
from copolicy.train.recipe import training_recipe
from copolicy.train.training_data import training_pairs


def chosen(root: Path, text: str) -> list[int]:
    return PairSplit.parse(text).episodes(LeRobotDatasetMetadata("local/set", root))


def test_named_pairs_and_all_others(people_set):
    assert chosen(people_set, "pairs:P02,P04") == [2, 3, 6, 7]
    assert chosen(people_set, "not-pairs:P02,P04") == [0, 1, 4, 5]


def test_a_fraction_and_its_complement_share_no_pair(people_set):
    for seed in range(4):
        part, rest = (chosen(people_set, f"{kind}:0.25:{seed}") for kind in ("pairs", "not-pairs"))
        assert len(part) == 2
        assert sorted(part + rest) == list(range(8))
        assert part[0] % 2 == 0
        assert part[1] == part[0] + 1
    assert chosen(people_set, "pairs:0.25") == chosen(people_set, "pairs:0.25:0")
    assert len({tuple(chosen(people_set, f"pairs:.25:{seed}")) for seed in range(8)}) > 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("P01", "--split: expected pairs:ID,ID, not-pairs:ID,ID, pairs:FRACTION[:SEED] or not-pairs:FRACTION[:SEED]"),
        ("pairs:,", "--split: expected pairs:ID,ID"),
        ("pairs:0.0", "--split: expected a fraction above 0 and below 1"),
        ("pairs:P09", "--split: expected pairs of the data set (P01, P02, P03, P04), found 'P09'"),
        ("not-pairs:P01,P02,P03,P04", "--split: expected a choice that leaves a pair, found"),
    ],
)
def test_another_split_is_refused_in_one_line(people_set, text, message):
    with pytest.raises(CopolicyError) as error:
        chosen(people_set, text)
    assert str(error.value).startswith(message)


def test_each_checkpoint_records_the_pairs_of_its_run(people_set, tmp_path, capsys):
    output = tmp_path / "run"
    assert main([*flags(people_set, output), "--split=pairs:P01,P03"]) == 0
    for step in (2, 4):
        folder = output / "checkpoints" / f"{step:06d}" / "pretrained_model"
        recorded = json.loads((folder / "training_data.json").read_text(encoding="utf-8"))
        assert recorded == {
            "repo_id": "local/set",
            "split": "pairs:P01,P03",
            "pairs": {"P01": 2, "P03": 2},
            "people": ["P01-a", "P01-b", "P03-a", "P03-b"],
            "sources": ["human"],
            "episodes": [0, 1, 4, 5],
            "content_hash": read_content(people_set).hash,
        }
        config = json.loads((folder / "train_config.json").read_text(encoding="utf-8"))
        assert config["dataset"]["episodes"] == [0, 1, 4, 5]
    data = training_recipe(folder, "x", True, [])["dataset"]
    assert (data["pair_id"], data["split"]) == ({"P01": 2, "P03": 2}, "pairs:P01,P03")
    found = training_pairs(folder)
    assert found is not None
    assert (sorted(found.pairs), found.simulated) == (["P01", "P03"], False)
    # Without the record it is read from the data set; an exported policy has it in its recipe.
    (folder / "training_data.json").unlink()
    from_data = training_pairs(folder)
    assert from_data is not None
    assert from_data.pairs == found.pairs

    resumed = ["--config_path=" + str(output), "--resume=true", "--steps=6"]
    assert main([*resumed, "--split=pairs:P02"]) == 2
    assert "--split: expected no such flag with --resume=true" in capsys.readouterr().err.splitlines()[-1]
    assert main(resumed) == 0
    record = output / "checkpoints" / "000006" / "pretrained_model" / "training_data.json"
    last = json.loads(record.read_text(encoding="utf-8"))
    assert last["episodes"] == [0, 1, 4, 5]
    assert main([*flags(people_set, tmp_path / "x"), "--split=pairs:P02", "--dataset.episodes=[1]"]) == 2
    assert "--split: expected no such flag beside --dataset.episodes" in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize("extra", [["--split"], ["--split=pairs:P01", "--split=pairs:P02"]])
def test_the_flag_is_given_once_with_a_value(people_set, tmp_path, capsys, extra):
    assert main([*flags(people_set, tmp_path / "x"), *extra]) == 2
    assert "copolicy-train: --split: expected" in capsys.readouterr().err.splitlines()[-1]
