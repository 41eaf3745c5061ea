"""`copolicy-convert mcap` in shards: the content of one conversion, whatever the shards, processes and kills."""

import json
import os
import re
import shutil
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from checked_data import make_data_set, make_recordings
from lerobot.datasets import LeRobotDataset

from copolicy.collect.recorder import EpisodeRecorder
from copolicy.collect.world import TableWorld
from copolicy.convert.cli import main
from copolicy.dataset.checks.checking import DATA_SET_RULES, RECORDING_RULES, RULES, check_dataset
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.task import MAP_SETS
from copolicy.dataset.versions.content import read_content

COMMAND = [sys.executable, "-c", "from copolicy.convert.cli import main; raise SystemExit(main())"]
EPISODES = 8


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """Recordings, and the data set that they become in one go."""
    folder = tmp_path_factory.mktemp("scale")
    make_recordings(folder / "recordings", EPISODES, seed=3)
    make_data_set(folder / "recordings", folder / "whole")
    return folder


def call(recordings: Path, root: Path, *flags: str) -> list[str]:
    return ["mcap", str(recordings), "--root", str(root), "--repo-id", "lab/table", "--license", "CC-BY-4.0", *flags]


def content(root: Path) -> str:
    return read_content(root).hash


def load(root: Path) -> Any:
    return LeRobotDataset("lab/table", root=root, video_backend="pyav")


def times_of(shards: Path) -> dict[str, int]:
    return {path.parent.name: path.stat().st_mtime_ns for path in shards.glob("shards/[0-9]*/shard.json")}


def record_rest(path: Path) -> None:
    """A recording of half a second in which nobody does anything."""
    config = MAP_SETS["training"][0]
    world = TableWorld(config)
    meta = EpisodeMeta("at-rest", map_id="training-00", map_set="training", pair_id="nobody")
    with EpisodeRecorder(path, config, meta) as recorder:
        for _ in range(15):
            world.step(np.zeros(4))
            recorder.step(np.zeros(4), world.pose, world.velocity, world.reward())
        recorder.finish(False, "timeout")


def damage(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-2000])


@pytest.mark.parametrize("size", [1, 3, 8, 100])
def test_shards_of_any_size_have_the_content_of_one_conversion(made, tmp_path, capsys, size):
    assert main(call(made / "recordings", tmp_path / "set", "--shard-episodes", str(size), "--json")) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    summary = json.loads(captured.out)
    shards = -(-EPISODES // size)
    assert (summary["episodes"], summary["shards"], summary["finished_before"]) == (EPISODES, shards, 0)
    assert content(tmp_path / "set") == content(made / "whole")
    for name in ("meta/info.json", "meta/copolicy.json"):
        assert json.loads((tmp_path / "set" / name).read_text()) == json.loads((made / "whole" / name).read_text())
    assert list(tmp_path.iterdir()) == [tmp_path / "set"]


def test_what_lerobot_loads_is_the_same(made, tmp_path):
    assert main(call(made / "recordings", tmp_path / "set", "--shard-episodes", "3", "--stats")) == 0
    merged, whole = load(tmp_path / "set"), load(made / "whole")
    assert merged.num_frames == whole.num_frames
    for index in range(0, whole.num_frames, 37):
        for name, value in whole[index].items():
            assert np.array_equal(merged[index][name], value), name
    for feature, kinds in whole.meta.stats.items():
        for kind, value in kinds.items():
            np.testing.assert_allclose(merged.meta.stats[feature][kind], value, rtol=1e-9, atol=1e-12)
    statistics = json.loads((tmp_path / "set/meta/copolicy_stats.json").read_text())
    assert statistics["dataset"]["episodes"] == EPISODES
    assert [finding for finding in check_dataset(tmp_path / "set").findings if finding.severity == "error"] == []


def test_shards_and_the_merged_set_are_held_against_every_rule(made, tmp_path, capsys):
    assert set(RECORDING_RULES) | set(DATA_SET_RULES) == set(RULES)
    recordings = Path(shutil.copytree(made / "recordings", tmp_path / "recordings"))
    shutil.copy(recordings / "episode_000000.mcap", recordings / "episode_000009.mcap")
    assert main(call(recordings, tmp_path / "twice", "--shard-episodes", "3")) == 1
    error = capsys.readouterr().err
    assert re.fullmatch(
        r"copolicy-convert: episode_uuid [\w-]+: expected every episode once, found it at 0 and 8\n", error
    )
    assert not (tmp_path / "twice").exists()
    (recordings / "episode_000009.mcap").unlink()
    record_rest(recordings / "episode_000006b.mcap")
    assert main(call(recordings, tmp_path / "set", "--shard-episodes", "3", "--shards", str(tmp_path / "shards"))) == 0
    kept = json.loads((tmp_path / "shards/findings.json").read_text())
    names = {rule.name for rule in RECORDING_RULES}
    applied = json.loads((tmp_path / "shards/shards/00000/shard.json").read_text())["applied"]
    assert set(applied) == names
    # The recordings' own rules find in shards what they find in all at once, episodes named by their index.
    labels = {path.name: str(place) for place, path in enumerate(sorted(recordings.glob("*.mcap")))}
    at_once = check_dataset(recordings).findings
    known = {finding.rule for finding in at_once}
    expected = {(f.rule, labels[f.episode], f.figure) for f in at_once if f.episode}
    assert {("short", "7", 0.5), ("idle", "7", 1.0)} <= expected
    assert expected <= {(entry["rule"], entry["episode"], entry["figure"]) for entry in kept}
    assert {"balance", "balance_pairs"} <= {entry["rule"] for entry in kept} & known


def test_a_finished_shard_is_not_made_again(made, tmp_path, capsys):
    recordings = Path(shutil.copytree(made / "recordings", tmp_path / "recordings"))
    shards, broken = tmp_path / "shards", recordings / "episode_000004.mcap"
    sound = broken.read_bytes()
    damage(broken)
    damage(recordings / "episode_000005.mcap")
    flags = ("--shard-episodes", "2", "--shards", str(shards))
    assert main(call(recordings, tmp_path / "set", *flags)) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"copolicy-convert: {broken}: expected an intact and complete MCAP file, found ")
    assert error.endswith(
        f" (and 1 more, in {shards / 'damaged'}); 3 of 4 shards are finished and kept in {shards}: mend or remove such "
        "files, or add --skip-damaged, and run again\n"
    )
    assert error.count("\n") == 1
    assert not (tmp_path / "set").exists()
    before = times_of(shards)
    assert set(before) == {"00000", "00001", "00003"}

    assert main(call(recordings, tmp_path / "without", *flags, "--skip-damaged", "--json")) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["episodes"], summary["finished_before"]) == (EPISODES - 2, 3)
    assert [message.split(":")[0] for message in summary["damaged_left_out"]] == [
        str(broken), str(recordings / "episode_000005.mcap"),
    ]  # fmt: skip
    left_out = json.loads((tmp_path / "without/meta/copolicy.json").read_text())["left_out"]
    assert left_out == {"damaged": ["episode_000004.mcap", "episode_000005.mcap"], "discarded": []}
    assert before.items() <= times_of(shards).items()

    broken.write_bytes(sound)
    shutil.copy(made / "recordings/episode_000005.mcap", recordings)
    assert main(call(recordings, tmp_path / "set", *flags)) == 0
    assert before.items() <= times_of(shards).items()
    assert content(tmp_path / "set") == content(made / "whole")


def test_a_shard_without_episodes_is_no_part_of_the_set(made, tmp_path, capsys):
    recordings = Path(shutil.copytree(made / "recordings", tmp_path / "recordings"))
    for number in (0, 1):
        damage(recordings / f"episode_{number:06d}.mcap")
    assert main(call(recordings, tmp_path / "set", "--shard-episodes", "2", "--skip-damaged")) == 0
    assert load(tmp_path / "set").num_episodes == EPISODES - 2
    for path in recordings.glob("*.mcap"):
        if path.name > "episode_000001.mcap":
            damage(path)
    capsys.readouterr()
    assert main(call(recordings, tmp_path / "none", "--shard-episodes", "2", "--skip-damaged")) == 1
    expected = f"copolicy-convert: {tmp_path / 'none'}: expected at least one episode to write, found none\n"
    assert capsys.readouterr().err == expected


def test_a_video_is_merged_with_the_same_content(made, tmp_path):
    recordings = tmp_path / "recordings"
    recordings.mkdir()
    for number in range(2):
        shutil.copy(made / f"recordings/episode_{number:06d}.mcap", recordings)
    flags = ("--video", "--video-size", "128x64")
    assert main(call(recordings, tmp_path / "whole", *flags)) == 0
    assert main(call(recordings, tmp_path / "set", *flags, "--shard-episodes", "1")) == 0
    assert content(tmp_path / "set") == content(tmp_path / "whole")
    merged, whole = load(tmp_path / "set"), load(tmp_path / "whole")
    last = whole.num_frames - 1
    assert np.array_equal(merged[last]["observation.images.scene"], whole[last]["observation.images.scene"])


def test_killed_processes_leave_nothing_half_and_a_rerun_finishes(made, tmp_path, capsys):
    """The command killed while it writes a shard, then a process of its pool, then the same call once more."""
    shards, root = tmp_path / "shards", tmp_path / "set"
    arguments = call(made / "recordings", root, "--shard-episodes", "1", "--shards", str(shards))

    def started() -> subprocess.Popen:
        command = [*COMMAND, *arguments, "--workers", "2"]
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def stopped_at_work(process: subprocess.Popen, finished: int) -> list[psutil.Process]:
        """The processes of the pool, halted where so many shards are there and another one is half written."""
        workers: list[psutil.Process] = []
        while process.poll() is None:
            if len(workers) < 2:
                children = psutil.Process(process.pid).children()
                workers = [child for child in children if any("spawn_main" in part for part in child.cmdline())]
            elif len(times_of(shards)) >= finished and any(shards.glob("shards/.*.partial/*")):
                for worker in workers:
                    worker.suspend()
                if any(shards.glob("shards/.*.partial/*")):
                    return workers
                for worker in workers:
                    worker.resume()
            time.sleep(0.0005)
        raise AssertionError(f"it ended first: {process.communicate()}")

    orphaned = started()
    workers = stopped_at_work(orphaned, 1)
    orphaned.kill()
    for worker in workers:
        worker.resume()
    assert psutil.wait_procs(workers, timeout=30)[1] == []
    assert orphaned.communicate(timeout=60)[0] == ""
    first = times_of(shards)
    assert 1 <= len(first) < EPISODES
    assert not root.exists()

    killed = started()
    for worker in stopped_at_work(killed, len(first) + 1):
        worker.send_signal(signal.SIGKILL)
    out, error = killed.communicate(timeout=60)
    second = times_of(shards)
    assert (killed.returncode, out) == (1, "")
    assert error == (
        f"copolicy-convert: {shards}: a process was killed, perhaps for want of memory; {len(second)} of {EPISODES} "
        f"shards are finished and kept in {shards}: run the same again\n"
    )
    assert first.items() < second.items()
    assert len(second) < EPISODES
    assert list(shards.glob("shards/.*.partial"))
    assert not root.exists()

    assert main(arguments) == 0
    assert capsys.readouterr().err == ""
    assert second.items() < times_of(shards).items()
    assert not list(shards.glob("shards/.*"))
    assert content(root) == content(made / "whole")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["set", "shards"]


def test_what_a_killed_merge_left_goes_away(made, tmp_path):
    left = tmp_path / ".set.merging"
    left.mkdir()
    (left / "half").write_text("")
    assert main(call(made / "recordings", tmp_path / "set", "--shard-episodes", "4")) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["set"]


@pytest.fixture
def cluster(tmp_path, monkeypatch) -> Path:
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
        "srun": '#!/bin/bash\nwhile [[ "$1" == -* ]]; do [ "$1" = -n ] && shift; shift; done\nexec "$@"\n',
        "scontrol": '#!/bin/bash\necho "${@: -1}"\n',
    }
    for name, text in programs.items():
        (folder / name).write_text(text)
        (folder / name).chmod((folder / name).stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("CLUSTER", str(folder))
    return folder


def test_slurm_jobs_make_the_shards_and_merge_them(made, tmp_path, cluster, capsys):
    recordings = Path(shutil.copytree(made / "recordings", tmp_path / "recordings"))
    for number in range(4, EPISODES):  # a job without episodes loads no LeRobot and is quick
        damage(recordings / f"episode_{number:06d}.mcap")
    assert main(call(recordings, tmp_path / "whole", "--skip-damaged")) == 0
    capsys.readouterr()
    shards, root = tmp_path / "shards", tmp_path / "set"
    flags = ["--executor", "slurm", "--shard-episodes", "4", "--shards", str(shards), "--skip-damaged", "--json"]
    more = ["--partition", "cpu", "--time", "00:20:00", "--sbatch", "account=lab", "--workers", "2"]
    assert main(call(recordings, root, *flags, *more)) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    summary = json.loads(captured.out)
    logs = {path.name: path.read_text() for path in sorted(cluster.glob("*.log"))}
    assert root.is_dir(), logs
    assert (summary["shards"], summary["finished_before"]) == (2, 0)
    script = (cluster / f"{summary['jobs']['shards']}.job").read_text().splitlines()
    assert script[0] == "#!/bin/bash"
    for option in ("array=0-1%2", "partition=cpu", "time=00:20:00", "account=lab", "mem-per-cpu=4G"):
        assert f"#SBATCH --{option}" in script
    assert not any(line.startswith("#SBATCH --qos") for line in script)
    merge = (cluster / f"{summary['jobs']['merge']}.job").read_text().splitlines()
    assert "#SBATCH --kill-on-invalid-dep=yes" in merge
    arguments = (cluster / f"{summary['jobs']['merge']}.arguments").read_text()
    assert f"--dependency=afterok:{summary['jobs']['shards']}" in arguments
    assert content(root) == content(tmp_path / "whole")
    assert json.loads((shards / "summary.json").read_text())["episodes"] == 4


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (("--executor", "slurm"), "--executor: expected sbatch on the PATH, for slurm, found 'none'"),
        (
            ("--executor", "ray"),
            "--executor: expected local or slurm, as ray is not installed (pip install ray), found 'ray'",
        ),
        (("--partition", "cpu"), "--partition: expected --executor slurm beside it, found 'local'"),
        (("--sbatch", "account=lab"), "--sbatch: expected --executor slurm beside it, found 'local'"),
        (
            ("--executor", "slurm", "--sbatch", "--account"),
            "--sbatch: expected KEY=VALUE, such as account=lab, found '--account'",
        ),
        (("--shard-episodes", "0"), "shard-episodes: expected at least 1, found 0"),
        (("--shards", "x", "--append"), "--append: expected without shards, whose flags stand beside it, found True"),
    ],
)
def test_a_wrong_call(made, tmp_path, capsys, monkeypatch, flags, message):
    monkeypatch.chdir(tmp_path)
    flags = [flag.replace("--account", "=lab") if flag == "--account" else flag for flag in flags]
    message = message.replace("'--account'", "'=lab'")
    root = made / "whole" if "--append" in flags else tmp_path / "set"
    assert main(call(made / "recordings", root, *flags)) == 2
    assert capsys.readouterr().err == f"copolicy-convert: {message}\n"
    assert not (tmp_path / "set").exists()


def test_slurm_needs_a_partition(made, tmp_path, cluster, capsys):
    assert main(call(made / "recordings", tmp_path / "set", "--executor", "slurm")) == 2
    expected = "copolicy-convert: --partition: expected a partition of the cluster, for --executor slurm, found None\n"
    assert capsys.readouterr().err == expected


def test_shards_of_another_call_are_refused(made, tmp_path, capsys):
    shards = tmp_path / "shards"
    flags = ("--shards", str(shards), "--shard-episodes", "4")
    assert main(call(made / "recordings", tmp_path / "set", *flags)) == 0
    before = times_of(shards)
    assert main(call(made / "recordings", tmp_path / "other", *flags, "--fps", "30")) == 2
    other = tmp_path / "photographs"
    other.mkdir()
    (other / "one.jpg").write_text("")
    assert main(call(made / "recordings", tmp_path / "other", "--shards", str(other))) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"copolicy-convert: fps of the shards in {shards}: expected 30 (finish that call first, or give another "
        "--shards), found 10",
        f"copolicy-convert: {other}: expected a new folder, or one with the shards of this call, found another",
    ]
    assert times_of(shards) == before
    assert list(other.iterdir()) == [other / "one.jpg"]


def test_two_calls_do_not_work_in_one_folder(made, tmp_path, capsys):
    shards = tmp_path / "shards"
    shards.mkdir()
    holder = (
        "import fcntl, sys, time; file = open(sys.argv[1], 'wb'); fcntl.flock(file, fcntl.LOCK_EX); print('held', "
        "flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", holder, str(shards / "lock")], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        assert main(call(made / "recordings", tmp_path / "set", "--shards", str(shards))) == 1
        process.kill()
    expected = f"copolicy-convert: {shards}: expected shards that nobody works on, found another call at work\n"
    assert capsys.readouterr().err == expected
    assert main(call(made / "recordings", tmp_path / "set", "--shards", str(shards))) == 0


@pytest.fixture
def without_datatrove(monkeypatch) -> Callable[[], None]:
    def hide() -> None:
        for name in [name for name in sys.modules if name.startswith("copolicy.convert.scale.")]:
            monkeypatch.delitem(sys.modules, name)
        for name in ("datatrove", "datatrove.executor", "datatrove.executor.local", "datatrove.pipeline.base"):
            monkeypatch.setitem(sys.modules, name, None)

    return hide


def test_without_the_extra_one_line_says_so(made, tmp_path, capsys, without_datatrove):
    without_datatrove()
    assert main(call(made / "recordings", tmp_path / "set", "--shard-episodes", "4")) == 2
    expected = (
        "copolicy-convert: datatrove is not installed: this command needs the extra, "
        "pip install 'lerobot_policy_copolicy[scale]'\n"
    )
    assert capsys.readouterr().err == expected
    assert list(tmp_path.iterdir()) == []
