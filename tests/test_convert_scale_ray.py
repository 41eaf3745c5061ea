"""Shards on Ray: with Ray itself where it is installed, and with the local executor in its place elsewhere."""

import importlib.util
import json
from importlib.util import find_spec
from pathlib import Path

import pytest
from sharded_calls import EPISODES, call, content

from copolicy.convert.cli import main


def _ray(unsharded: Path, root: Path, *flags: str) -> list[str]:
    return call(unsharded / "recordings", root, "--executor", "ray", "--workers", "1", "--shard-episodes", "3", *flags)


def test_the_set_is_that_of_one_conversion_and_no_shards_are_left(ray, unsharded, tmp_path, capsys):
    assert main(_ray(unsharded, tmp_path / "set", "--json")) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["episodes"], summary["shards"]) == (EPISODES, 2)
    assert "kept" not in summary
    assert content(tmp_path / "set") == content(unsharded / "whole")
    assert list(tmp_path.iterdir()) == [tmp_path / "set"]


def test_shards_in_a_named_folder_are_kept(ray, unsharded, tmp_path, capsys):
    assert main(_ray(unsharded, tmp_path / "set", "--shards", str(tmp_path / "shards"), "--json")) == 0
    assert json.loads(capsys.readouterr().out)["kept"] == str(tmp_path / "shards")
    assert (tmp_path / "shards" / "findings.json").is_file()


def test_no_cluster_at_the_address_of_the_environment_leaves_nothing(ray, unsharded, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("RAY_ADDRESS", "127.0.0.1:1")
    assert main(_ray(unsharded, tmp_path / "set")) == 2
    told = capsys.readouterr().err
    assert told.startswith("copolicy-convert: RAY_ADDRESS: expected a Ray cluster that answers, found '127.0.0.1:1: ")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("executor", ["ray", "slurm"])
def test_an_executor_that_is_not_here_leaves_nothing(unsharded, tmp_path, monkeypatch, executor):
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ray" else find_spec(name))
    assert main(call(unsharded / "recordings", tmp_path / "set", "--executor", executor)) == 2
    assert list(tmp_path.iterdir()) == []
