"""Conversions in shards as SLURM jobs, on programs that stand for a cluster's."""

import json
import shutil
from pathlib import Path

import pytest
from sharded_calls import EPISODES, call, content, damage
from slurm_cluster import stand_in_cluster

from copolicy.convert.cli import main


@pytest.fixture
def cluster(tmp_path, monkeypatch, warm_python) -> Path:
    return stand_in_cluster(tmp_path / "cluster", monkeypatch, warm_python)


def test_slurm_jobs_make_the_shards_and_merge_them(unsharded, tmp_path, cluster, capsys):
    recordings = Path(shutil.copytree(unsharded / "recordings", tmp_path / "recordings"))
    for number in range(3, EPISODES):  # a job without episodes loads no LeRobot and is quick
        damage(recordings / f"episode_{number:06d}.mcap")
    assert main(call(recordings, tmp_path / "whole", "--skip-damaged")) == 0
    capsys.readouterr()
    shards, root = tmp_path / "shards", tmp_path / "set"
    flags = ["--executor", "slurm", "--shard-episodes", "3", "--shards", str(shards), "--skip-damaged", "--json"]
    more = ["--partition", "cpu", "--time", "00:20:00", "--sbatch", "account=lab", "--workers", "2"]
    assert main(call(recordings, root, *flags, *more)) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    summary = json.loads(captured.out)
    logs = {path.name: path.read_text(encoding="utf-8") for path in sorted(cluster.glob("*.log"))}
    assert root.is_dir(), logs
    assert (summary["shards"], summary["finished_before"]) == (2, 0)
    script = (cluster / f"{summary['jobs']['shards']}.job").read_text(encoding="utf-8").splitlines()
    assert script[0] == "#!/bin/bash"
    for option in ("array=0-1%2", "partition=cpu", "time=00:20:00", "account=lab", "mem-per-cpu=4G"):
        assert f"#SBATCH --{option}" in script
    assert not any(line.startswith("#SBATCH --qos") for line in script)
    merge = (cluster / f"{summary['jobs']['merge']}.job").read_text(encoding="utf-8").splitlines()
    assert "#SBATCH --kill-on-invalid-dep=yes" in merge
    arguments = (cluster / f"{summary['jobs']['merge']}.arguments").read_text(encoding="utf-8")
    assert f"--dependency=afterok:{summary['jobs']['shards']}" in arguments
    assert content(root) == content(tmp_path / "whole")
    assert json.loads((shards / "summary.json").read_text(encoding="utf-8"))["episodes"] == 3


def test_slurm_needs_a_partition(unsharded, tmp_path, cluster, capsys):
    assert main(call(unsharded / "recordings", tmp_path / "set", "--executor", "slurm")) == 2
    expected = "copolicy-convert: --partition: expected a partition of the cluster, for --executor slurm, found None\n"
    assert capsys.readouterr().err == expected
