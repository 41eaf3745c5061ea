"""Sweeps on Ray (itself where it is installed, else the local executor in its place) and on stand-ins for SLURM."""

import json
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from policy_runs import save_run
from ray_stand_in import ClusterStandIn
from slurm_cluster import stand_in_cluster

from copolicy.dataset.distributed.executors import _slurm
from copolicy.dataset.distributed.flags import Distribution, SlurmOptions
from copolicy.dataset.distributed.job import Job, Step
from copolicy.dataset.distributed.ray_executor import _cluster
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.evaluate.cli import main


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    return save_run(tmp_path_factory.mktemp("method") / "seed_0")


@pytest.fixture(scope="module")
def digest(run, tmp_path_factory) -> str:
    """The results of one process."""
    out = tmp_path_factory.mktemp("local") / "out"
    assert sweep(run, out) == 0
    return table(out)["results_sha256"]


def sweep(run: Path, out: Path, *flags: str) -> int:
    limits = ("--limit", "2", "--configurations", "4", "--step-limit", "24", "--maps", "unseen")
    return main(
        ["sweep", "--runs", f"ours={run}", "--partners", "stubborn", "--out", str(out), *limits, *flags, "--json"]
    )


def table(out: Path) -> dict:
    return json.loads((out / "sweep.json").read_text(encoding="utf-8"))


def test_ray_gives_the_results_of_one_process(ray, run, digest, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(run, "run", symlinks=True)
    assert sweep(Path("run"), Path("out"), "--executor", "ray", "--workers", "2") == 0
    assert table(Path("out"))["results_sha256"] == digest


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("127.0.0.1:1", "expected a Ray cluster that answers, found '127.0.0.1:1: "),
        ("ray://127.0.0.1:1", "expected a Ray cluster that answers, found 'ray://127.0.0.1:1: "),
        ("cluster", "expected HOST:PORT, ray://HOST:PORT or auto, found 'cluster'"),
    ],
)
def test_an_address_without_a_cluster_is_one_line(ray, run, tmp_path, capsys, address, message):
    assert sweep(run, tmp_path / "out", "--executor", "ray", "--address", address) == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith(f"copolicy-eval: --address: {message}")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("variable", "flags", "message"),
    [
        ("127.0.0.1:1", (), "RAY_ADDRESS: expected a Ray cluster that answers, found '127.0.0.1:1: "),
        ("ray://127.0.0.1:1", ("--address", "auto"), "RAY_ADDRESS: expected a Ray cluster that answers, found 'ray:"),
        ("127.0.0.1:2", ("--address", "[::1]:1"), "--address: expected a Ray cluster that answers, found '[::1]:1: "),
        ("http://127.0.0.1:8265", (), "RAY_ADDRESS: expected HOST:PORT, ray://HOST:PORT or auto, found 'http://127"),
    ],
)
def test_the_environments_address_counts_as_in_ray(ray, run, tmp_path, capsys, monkeypatch, variable, flags, message):
    monkeypatch.setenv("RAY_ADDRESS", variable)
    assert sweep(run, tmp_path / "out", "--executor", "ray", *flags) == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith(f"copolicy-eval: {message}")
    assert not (tmp_path / "out").exists()


def test_an_address_in_the_environment_is_asked_only_where_ray_would_connect_to_it(ray, monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as server:
        monkeypatch.setenv("RAY_ADDRESS", f"127.0.0.1:{server.getsockname()[1]}")
        Distribution("ray").require()
    monkeypatch.setenv("RAY_ADDRESS", "anyscale://our-cluster")
    Distribution("ray").require()
    monkeypatch.setenv("RAY_ADDRESS", "127.0.0.1:1")
    Distribution("local").require()
    Distribution("ray", address="local").require()
    monkeypatch.setitem(sys.modules, "ray", ClusterStandIn(connected=True))  # of a notebook, say
    Distribution("ray").require()


@pytest.mark.parametrize(
    ("variable", "address", "name", "place"),
    [
        ("10.0.0.5:6379", None, "RAY_ADDRESS", "10.0.0.5:6379"),
        ("10.0.0.5:6379", "auto", "RAY_ADDRESS", "10.0.0.5:6379"),
        ("10.0.0.5:6379", "10.0.0.6:6379", "--address", "10.0.0.6:6379"),
        ("", "auto", "--address", "auto"),
    ],
)
def test_an_address_without_a_cluster_is_named_by_what_states_it(monkeypatch, variable, address, name, place):
    cluster = ClusterStandIn(RuntimeError("no head node\nat all"))
    monkeypatch.setitem(sys.modules, "ray", cluster)
    monkeypatch.setenv("RAY_ADDRESS", variable)
    with pytest.raises(InvalidValueError) as error, _cluster(address):
        pass
    assert str(error.value) == f"{name}: expected a Ray cluster that answers, found '{place}: no head node'"
    assert cluster.addresses == [address]  # Ray itself reads the variable


class Nothing(Step):
    def run(self, data=None, rank: int = 0, world_size: int = 1) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        pass


def test_paths_and_variables_with_spaces_reach_a_job_whole(tmp_path, monkeypatch):
    environment = tmp_path / "our environment"
    (environment / "bin").mkdir(parents=True)
    (environment / "bin" / "activate").write_text("ACTIVE='yes, it is'", encoding="utf-8")
    monkeypatch.setattr(sys, "prefix", str(environment))
    job = Job(Nothing(None), 1, tmp_path, tmp_path / "logs", "tasks", lambda: 0, environment={"OUR_FLAGS": "-a b; c"})
    setup = _slurm(job, Distribution("slurm", slurm=SlurmOptions(partition="cpu"))).env_command
    told = subprocess.run(
        ["bash", "-c", f'{setup}; echo "$ACTIVE, $OUR_FLAGS"'], capture_output=True, text=True, check=True
    )
    assert (told.stdout, told.stderr) == ("yes, it is, -a b; c\n", "")


def test_slurm_jobs_run_the_tasks_and_make_the_table(run, digest, tmp_path, monkeypatch, warm_python, capsys):
    cluster = stand_in_cluster(tmp_path / "cluster", monkeypatch, warm_python)
    out = tmp_path / "out"
    flags = ("--executor", "slurm", "--partition", "cpu", "--time", "00:20:00", "--sbatch", "account=lab")
    assert sweep(run, out, *flags, "--workers", "1", "--memory-gb", "6") == 0
    summary = json.loads(capsys.readouterr().out)
    logs = {path.name: path.read_text(encoding="utf-8") for path in sorted(cluster.glob("*.log"))}
    assert (out / "sweep.json").is_file(), logs
    assert (summary["tasks"], summary["finished_before"]) == (2, 0)
    script = (cluster / f"{summary['jobs']['tasks']}.job").read_text(encoding="utf-8").splitlines()
    options = ("array=0-1%1", "partition=cpu", "time=00:20:00", "account=lab", "mem-per-cpu=6G", "cpus-per-task=1")
    for option in options:
        assert f"#SBATCH --{option}" in script
    (setup,) = [line for line in script if line.startswith("export OMP_NUM_THREADS=1")]
    assert sys.prefix in setup
    arguments = (cluster / f"{summary['jobs']['sweep-table']}.arguments").read_text(encoding="utf-8")
    assert f"--dependency=afterok:{summary['jobs']['tasks']}" in arguments
    assert table(out)["results_sha256"] == digest
    assert main(["sweep", "--out", str(out), "--collect"]) == 0
