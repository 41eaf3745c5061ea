"""Conversions in shards as SLURM jobs, on programs that stand for a cluster's."""

import json
import os
import shlex
import shutil
import stat
from pathlib import Path

import pytest
from sharded_calls import EPISODES, call, content, damage

from copolicy.convert.cli import main


@pytest.fixture
def cluster(tmp_path, monkeypatch, warm_python) -> Path:
    """Programs that stand for a cluster's: `sbatch` keeps a script and runs it here, once for each array index."""
    folder = tmp_path / "cluster"
    folder.mkdir()
    programs = {
        "sbatch": """#!/bin/bash
script="${@: -1}"
number=$(($(ls "$CLUSTER"/*.job 2>/dev/null | wc -l) + 1))
cp "$script" "$CLUSTER/$number.job"
echo "$@" >"$CLUSTER/$number.arguments"
last=$(sed -n 's/^#SBATCH --array=0-\\([0-9]*\\).*/\\1/p' "$script")
for index in $(seq 0 "$last"); do
  SLURM_ARRAY_TASK_ID=$index SLURM_NODELIST=node SLURM_JOB_ID=$number bash "$script" >>"$CLUSTER/$number.log" 2>&1
done
echo "Submitted batch job $number"
""",
        "srun": f"""#!/bin/bash
while [[ "$1" == -* ]]; do [ "$1" = -n ] && shift; shift; done
exec {shlex.join(warm_python)} "$(command -v "$1")" "${{@:2}}"
""",
        "scontrol": '#!/bin/bash\necho "${@: -1}"\n',
    }
    for name, text in programs.items():
        (folder / name).write_text(text, encoding="utf-8")
        (folder / name).chmod((folder / name).stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("CLUSTER", str(folder))
    return folder


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
