"""Pairs that a robot and a proxy have both learned from: they are refused, or recorded."""

import json
from pathlib import Path

import pytest
from untrained_policy import save_untrained_policy

from copolicy.collect.agents.checkpoint_folder import pretrained_folder
from copolicy.evaluate.cli import main
from copolicy.evaluate.partners.overlap import check_overlap
from copolicy.train.training_data import TRAINING_DATA_FILE, training_pairs


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory) -> Path:
    """An untrained co-policy, which plans rest."""
    return save_untrained_policy(tmp_path_factory.mktemp("checkpoint") / "still")


def record_pairs(checkpoint, folder, pairs, **more):
    """A copy of a checkpoint that says which pairs it learned from."""
    folder.mkdir()
    for path in checkpoint.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    facts = {"repo_id": "lab/a", "content_hash": "x", "pairs": pairs, "sources": ["human"], "people": [], **more}
    (folder / TRAINING_DATA_FILE).write_text(json.dumps(facts), encoding="utf-8")
    return folder


def test_common_pairs_are_refused_unless_allowed(checkpoint, tmp_path, capsys):
    robot = record_pairs(checkpoint, tmp_path / "robot", {"P01": 3, "P02": 1})
    proxy = record_pairs(checkpoint, tmp_path / "proxy", {"P02": 2, "P03": 2})
    other = record_pairs(checkpoint, tmp_path / "other", {"P03": 2})
    limits = ("--configurations", "4", "--step-limit", "30", "--maps", "unseen")
    call = ["cross-play", "--robots", f"ours={robot}", "--partners", f"proxy:{proxy}", *limits]
    assert main([*call, "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err.strip().splitlines()[-1]
    assert told.endswith(
        "expected a robot and a proxy (ours and proxy:proxy) that share no pair, or --allow-overlap, found 'P02'"
    )
    assert not (tmp_path / "out").exists()
    call = ["partner", f"ours={robot}", "--partners", f"proxy:{proxy}", "--configurations", "4", "--step-limit", "10"]
    assert main([*call, "--out", str(tmp_path / "partner.json")]) == 2
    assert main([*call, "--allow-overlap", "--out", str(tmp_path / "partner.json")]) == 0
    result = json.loads((tmp_path / "partner.json").read_text(encoding="utf-8"))
    assert result["overlap"]["shared"] == {"ours": {"proxy:proxy": ["P02"]}}
    assert result["summary"]["partner_changes"] is None
    assert result["settings"]["partners"]["proxy:proxy"]["kind"] == "proxy"
    assert "shared" not in check_overlap({"r": robot}, {"p": other}, False)


def test_equal_names_are_the_same_pair_only_of_the_same_data_or_if_simulated(checkpoint, tmp_path):
    def pairs(name, **more):
        found = training_pairs(record_pairs(checkpoint, tmp_path / name, {"P01": 1}, **more))
        assert found is not None
        return found

    one = pairs("one")
    other_lab = pairs("other_lab", repo_id="lab/b", content_hash="y")
    assert one.shared_with(other_lab) == []
    assert one.shared_with(pairs("new_version", content_hash="z")) == ["P01"]
    simulated = [pairs(f"simulated{k}", sources=["simulated"], repo_id=f"lab/{k}", content_hash=str(k)) for k in (1, 2)]
    assert simulated[0].shared_with(simulated[1]) == ["P01"]
    assert one.shared_with(pairs("unknown", repo_id=None, content_hash=None)) == ["P01"]
    found = check_overlap({"r": tmp_path / "one"}, {"p": tmp_path / "other_lab"}, False)
    assert found["same_names"] == {"r": {"p": ["P01"]}}


def test_the_shipped_policy_records_its_pairs():
    found = training_pairs(pretrained_folder())
    assert found is not None
    assert (sorted(found.pairs), found.simulated) == (["S01", "S02", "S03", "S04", "S05"], True)
