"""Sweeps: one result a task, what is missing is run and no more, other settings are noticed, a table over seeds."""

import csv
import json
import math
import re
import shutil
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import torch
from policy_runs import save_run

from copolicy.collect.cli import main as collect
from copolicy.dataset.task import get_task
from copolicy.evaluate.cli import main
from copolicy.evaluate.sweep import tasks
from copolicy.evaluate.trajectories import trajectories_beside
from copolicy.evaluate.trajectory_sources import read_sources

SHORT = ("--limit", "2", "--configurations", "4", "--step-limit", "24", "--maps", "unseen", "--partners", "stubborn")


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A method with two seeds."""
    folder = tmp_path_factory.mktemp("methods")
    for seed in (1, 0):
        save_run(folder / "codp-h" / f"seed_{seed}" / "training", seed=seed)
    return folder / "codp-h"


@pytest.fixture(scope="module")
def swept(made, tmp_path_factory) -> Path:
    """A finished sweep of it, in one process."""
    out = tmp_path_factory.mktemp("swept") / "out"
    assert sweep(made, out) == 0
    return out


@pytest.fixture
def copied(swept, tmp_path) -> Path:
    return Path(shutil.copytree(swept, tmp_path / "out"))


def sweep(runs: Path, out: Path, *flags: str) -> int:
    return main(["sweep", "--runs", f"CoDP-H={runs}", "--out", str(out), *SHORT, *flags, "--json"])


def table(out: Path) -> dict[str, Any]:
    return json.loads((out / "sweep.json").read_text(encoding="utf-8"))


def results(out: Path) -> dict[str, int]:
    """When each result was written."""
    return {path.name: path.stat().st_mtime_ns for path in out.glob("tasks/*.json")}


def result_of(out: Path, run: int, partner: str) -> tuple[Path, dict[str, Any]]:
    (path,) = out.glob(f"tasks/CoDP-H--{run}--unseen--{partner}--*.json")
    return path, json.loads(path.read_text(encoding="utf-8"))


def told(capsys) -> str:
    return capsys.readouterr().err.strip().splitlines()[-1].removeprefix("copolicy-eval: ")


def test_a_task_is_one_result_of_its_study(made, swept, tmp_path, capsys):
    assert len(results(swept)) == 4
    run = str(made / "seed_1" / "training")
    limits = ["--step-limit", "24", "--maps", "unseen", "--out", str(tmp_path / "alone.json")]
    studies = {
        "co-planning": ["coplan", "--policy", run, "--limit", "2"],
        "stubborn": ["partner", f"CoDP-H={run}", "--partners", "stubborn", "--no-baseline", "--configurations", "4"],
    }
    for partner, call in studies.items():
        assert main([*call, *limits, "--overwrite"]) == 0
        alone = json.loads((tmp_path / "alone.json").read_text(encoding="utf-8"))
        path, found = result_of(swept, 1, partner)
        for name in ("study", "label", "policy", "settings", "episodes"):
            assert found[name] == alone[name]
        assert found["summary"].keys() == alone["summary"].keys()
        other = result_of(swept, 0, partner)[0]
        assert main(["compare", str(path), str(other)]) == 0


def test_the_table_has_a_row_for_each_task(swept):
    rows = list(csv.DictReader((swept / "sweep.csv").read_text(encoding="utf-8").splitlines()))
    assert [(row["method"], row["seed"], row["maps"], row["partner"]) for row in rows] == [
        ("CoDP-H", seed, "unseen", partner) for seed in "01" for partner in ("co-planning", "stubborn")
    ]
    for row, of in zip(rows, table(swept)["tasks"], strict=True):
        path, result = result_of(swept, int(row["seed"]), row["partner"])
        assert row["file"] == f"tasks/{path.name}"
        episodes = result["episodes"]
        assert int(row["episodes"]) == len(episodes) == (2 if row["partner"] == "co-planning" else 4)
        assert float(row["interaction_force"]) == pytest.approx(
            np.mean([each["interaction_mean"] for each in episodes])
        )
        assert (row["robot_share"] == "") is (row["partner"] == "co-planning")
        assert float(row["wall_s"]) > 0
        assert row["episodes_sha256"] == of["episodes_sha256"] == result["sweep"]["episodes_sha256"]
    assert len({row["episodes_sha256"] for row in rows}) == 4
    text = (swept / "sweep.md").read_text(encoding="utf-8")
    assert "no person took part" in text
    assert "unit of analysis: training run" in text
    assert [line for line in text.splitlines() if line.startswith("## ")] == [
        "## unseen: co-planning", "## unseen: partner stubborn", "## Definitions",
    ]  # fmt: skip


def test_a_second_call_runs_what_is_missing(made, copied, capsys):
    before, digests = results(copied), table(copied)["results_sha256"]
    lost = result_of(copied, 0, "stubborn")[0]
    lost.unlink()
    partial = lost.with_name(f".{lost.name}.0123abcd.partial")  # of a killed process
    partial.write_text("{", encoding="utf-8")
    capsys.readouterr()
    assert sweep(made, copied) == 0
    assert json.loads(capsys.readouterr().out)["finished_before"] == 3
    assert table(copied)["results_sha256"] == digests
    assert {name: when for name, when in results(copied).items() if name != lost.name} == {
        name: when for name, when in before.items() if name != lost.name
    }
    assert lost.exists()
    assert not partial.exists()
    after = results(copied)
    assert sweep(made, copied, "--partners", "stubborn", "slow") == 0
    assert json.loads(capsys.readouterr().out)["finished_before"] == 4
    assert after.items() < results(copied).items()
    assert [row["partner"] for row in table(copied)["groups"]] == ["co-planning", "stubborn", "slow"]


def test_killed_workers_lose_no_finished_task(made, tmp_path, capsys):
    out, ended = tmp_path / "out", threading.Event()
    flags = ("--repeats", "3", "--partners", "stubborn", "slow", "follower")  # 8 tasks

    def kill() -> None:
        """The process of one worker as soon as there is a result."""
        while not results(out) and not ended.is_set():
            time.sleep(0.005)
        children = psutil.Process().children()
        with suppress(psutil.NoSuchProcess):
            next(child for child in children if any("spawn_main" in text for text in child.cmdline())).kill()

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        assert sweep(made, out, *flags, "--workers", "2") == 1
    finally:
        ended.set()
        killer.join()
    finished = results(out)
    assert 1 <= len(finished) < 8
    assert told(capsys) == (
        f"{out}: a process was killed, perhaps out of memory; {len(finished)} of 8 tasks are finished and kept in "
        f"{out}: run the command again"
    )
    assert not (out / "sweep.json").exists()
    assert sweep(made, out, *flags) == 0
    assert json.loads(capsys.readouterr().out)["finished_before"] == len(finished)
    assert finished.items() < results(out).items()
    assert not list(out.glob("tasks/.*"))
    assert sweep(made, tmp_path / "one", *flags) == 0  # all in one process
    first, second = ({**table(folder), "tasks": [], "groups": []} for folder in (out, tmp_path / "one"))
    assert first == second
    for path in out.glob("tasks/*.json"):
        pair = [
            json.loads((folder / "tasks" / path.name).read_text(encoding="utf-8")) for folder in (out, tmp_path / "one")
        ]
        for result in pair:
            del result["sweep"]["wall_s"]
            del result["summary"]["planning_ms_per_call"], result["summary"]["planning_ms_per_table"]
        assert pair[0] == pair[1]


def test_results_of_other_settings_weights_and_partners_are_refused(made, copied, tmp_path, capsys):
    path = result_of(copied, 0, "co-planning")[0]
    before = results(copied)

    def refused(runs: Path, *flags: str) -> str:
        assert sweep(runs, copied, *flags) == 2
        assert results(copied) == before
        return told(capsys)

    line = refused(made, "--seed", "1")
    assert line == f"{path}: expected seed 1 as in this run (another --out, or --overwrite), found 'seed 0'"
    assert ": expected threads 2 as in this run" in refused(made, "--threads", "2")
    assert ": expected world.step_limit 27 as in this run" in refused(made, "--step-limit", "27")
    assert ": expected overrides.num_inference_steps 3 as in this run" in refused(made, "--num-inference-steps", "3")
    assert ': expected device "cuda" as in this run' in refused(made, "--device", "cuda:1")
    other = Path(shutil.copytree(made, tmp_path / "other", symlinks=True))
    shutil.rmtree(other / "seed_1")
    save_run(other / "seed_1" / "training", seed=1, weights=7)
    line = refused(other)
    assert line.startswith(f"{result_of(copied, 1, 'co-planning')[0]}: expected weights_sha256 ")
    sound = Path(shutil.copytree(made, tmp_path / "sound", symlinks=True))
    (processor,) = sound.glob("seed_1/training/checkpoints/000100/pretrained_model/policy_preprocessor.json")
    processor.write_text(processor.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    assert ": expected processors_sha256 " in refused(sound)
    path.write_text("{}", encoding="utf-8")
    before = results(copied)
    assert refused(made).startswith(f"{path}: expected the result of a task of a sweep, ")


def test_overwrite_replaces_results_of_other_settings_alone(made, copied, tmp_path, capsys):
    other = Path(shutil.copytree(made, tmp_path / "other", symlinks=True))
    shutil.rmtree(other / "seed_1")
    save_run(other / "seed_1" / "training", seed=1, weights=7)
    before = results(copied)
    capsys.readouterr()
    assert sweep(other, copied, "--overwrite") == 0
    assert json.loads(capsys.readouterr().out)["finished_before"] == 2
    changed = {name for name, when in results(copied).items() if before[name] != when}
    assert changed == {result_of(copied, 1, partner)[0].name for partner in ("co-planning", "stubborn")}


def test_trajectories_are_those_of_the_results(made, copied, capsys):
    """A finished task without them is run again, with the same result; another call leaves them where they are."""
    digests = table(copied)["results_sha256"]
    capsys.readouterr()
    assert sweep(made, copied, "--trajectories") == 0
    assert json.loads(capsys.readouterr().out)["finished_before"] == 0
    assert table(copied)["results_sha256"] == digests
    before = results(copied)
    for path in before:
        result = json.loads((copied / "tasks" / path).read_text(encoding="utf-8"))
        (source,) = read_sources([f"S={copied / 'tasks' / path}"])[1]
        assert source.label == result["label"]
        robot = f"{result['sweep']['method']} {result['sweep']['run']}"
        assert [episode.columns for episode in source.episodes] == [
            {"robot": robot, **row} for row in result["episodes"]
        ]
        assert [len(episode.actions) for episode in source.episodes] == [row["steps"] for row in result["episodes"]]
    for flags in ((), ("--trajectories",)):
        assert sweep(made, copied, *flags) == 0
        assert json.loads(capsys.readouterr().out)["finished_before"] == 4
    assert results(copied) == before
    lost = trajectories_beside(result_of(copied, 0, "stubborn")[0])
    lost.unlink()
    partial = lost.with_name(f".{lost.name}.0123abcd.partial")  # of a killed process
    partial.write_bytes(b"")
    assert sweep(made, copied, "--trajectories") == 0
    assert json.loads(capsys.readouterr().out)["finished_before"] == 3
    assert lost.exists()
    assert not partial.exists()
    assert sweep(made, copied, "--overwrite", "--step-limit", "12") == 0
    assert not list(copied.glob("tasks/*.parquet"))


def test_a_failed_task_does_not_stop_the_others(made, tmp_path, capsys):
    runs = Path(shutil.copytree(made, tmp_path / "runs", symlinks=True))
    (processor,) = runs.glob("seed_0/training/checkpoints/000100/pretrained_model/policy_preprocessor.json")
    text = processor.read_text(encoding="utf-8")
    processor.write_text("{", encoding="utf-8")
    assert sweep(runs, tmp_path / "out") == 1
    line = told(capsys)
    folder = runs / "seed_0" / "training" / "checkpoints" / "last" / "pretrained_model"
    assert line.startswith(f"{folder}: expected a policy that LeRobot can load, found ")
    ending = f" (and 1 more failed tasks); 2 of 4 tasks are finished and kept in {tmp_path / 'out'}"
    assert line.endswith(ending)
    processor.write_text(text, encoding="utf-8")
    assert sweep(runs, tmp_path / "out") == 0


def test_a_policy_that_changes_during_its_task_is_noticed(made, tmp_path, capsys, monkeypatch):
    runs = Path(shutil.copytree(made, tmp_path / "runs", symlinks=True))
    (processor,) = runs.glob("seed_0/training/checkpoints/000100/pretrained_model/policy_preprocessor.json")
    original = tasks._coplanning

    def changing(*arguments):
        result = original(*arguments)
        processor.write_text(processor.read_text(encoding="utf-8") + "\n", encoding="utf-8")
        return result

    monkeypatch.setattr(tasks, "_coplanning", changing)
    flags = ("--runs", str(runs / "seed_0"), "--partners", "stubborn")
    assert sweep(made, tmp_path / "out", *flags) == 1
    assert "expected processors_sha256 as at the start of the sweep, found others; nothing was written" in told(capsys)
    assert results(tmp_path / "out") == {}


def test_a_task_has_one_thread_unless_told_otherwise(made, tmp_path, monkeypatch):
    threads = []
    original = tasks._coplanning
    monkeypatch.setattr(
        tasks, "_coplanning", lambda *arguments: threads.append(torch.get_num_threads()) or original(*arguments)
    )
    before = torch.get_num_threads()
    torch.set_num_threads(3)
    try:
        for count, flags in ((1, ()), (2, ("--threads", "2"))):
            assert sweep(made / "seed_0", tmp_path / str(count), *flags) == 0
        assert (threads, torch.get_num_threads()) == ([1, 2], 3)
    finally:
        torch.set_num_threads(before)


def _set_successes(out: Path, run: int, partner: str, successes: list[int]) -> None:
    path, result = result_of(out, run, partner)
    for row, success in zip(result["episodes"], successes, strict=True):
        row["success"], row["time_s"], row["interaction_mean"] = bool(success), 10.0 + 2 * run, 0.25
    path.write_text(json.dumps(result), encoding="utf-8")


def test_means_are_over_seeds_and_a_single_seed_says_so(copied, capsys):
    for run, (alone, with_partner) in enumerate((([1, 1], [1, 1, 1, 1]), ([1, 0], [1, 0, 1, 0]))):
        _set_successes(copied, run, "co-planning", alone)
        _set_successes(copied, run, "stubborn", with_partner)
    assert main(["sweep", "--out", str(copied), "--collect", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["success"]["CoDP-H, unseen, co-planning"] == "75.0 ± 25.0 % (over 2 seeds)"
    alone, with_partner = table(copied)["groups"]
    assert alone["success"] == {
        "mean": 0.75, "standard_error": pytest.approx(np.std([1, 0.5], ddof=1) / math.sqrt(2)),
        "standard_error_of": "between runs", "runs": 2,
    }  # fmt: skip
    assert with_partner["time_s"]["mean"] == 11.0
    row = table(copied)["tasks"][2]
    assert (row["success"], row["map_count"]) == (0.5, 2)
    assert row["success_standard_error"] == pytest.approx(0.5 / math.sqrt(2), rel=0.05)  # of two maps
    # All starts of the study with a partner are of one map, which has no standard error over maps.
    assert table(copied)["tasks"][3]["success_standard_error"] is None
    assert "| CoDP-H | 2 | 4 | 75.0 ± 25.0 |" in (copied / "sweep.md").read_text(encoding="utf-8")

    lost = result_of(copied, 0, "co-planning")[0]
    lost.unlink()
    assert main(["sweep", "--out", str(copied), "--collect", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["missing"] == 1
    assert table(copied)["missing"] == [{"method": "CoDP-H", "run": "0", "maps": "unseen", "partner": "co-planning"}]
    assert table(copied)["groups"][-1]["success"]["standard_error_of"] == "over maps, one run"
    assert "## Missing: 1 tasks" in (copied / "sweep.md").read_text(encoding="utf-8")


def test_a_replay_is_run_once_in_its_own_starts(made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    call = ["--episodes", "3", "--seed", "2", "--maps", "training", "--workers", "1", "--out", "recordings"]
    assert collect(["simulate", *call]) == 0
    flags = ("--partners", "r=replay:recordings", "--maps", "holdout", "unseen", "--no-coplanning")
    assert sweep(made / "seed_0", Path("out"), *flags) == 0
    ((name, maps, episodes),) = [(row["partner"], row["maps"], row["episodes"]) for row in table(Path("out"))["tasks"]]
    assert (name, maps, episodes) == ("r", "recorded", 3)


def test_two_calls_do_not_work_in_one_folder(made, tmp_path, capsys):
    out = tmp_path / "out"
    out.mkdir()
    holder = (
        "import fcntl, sys, time; file = open(sys.argv[1], 'wb'); fcntl.flock(file, fcntl.LOCK_EX); print('held', "
        "flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", holder, str(out / "lock")], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        assert sweep(made, out) == 1
        process.kill()
    assert told(capsys) == f"{out}: expected a sweep that no other call works on, found one at work"


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (
            ("--executor", "ray"),
            "--executor: expected local or slurm, as ray is not installed (pip install ray), found",
        ),
        (("--executor", "slurm"), "--executor: expected sbatch on the PATH, for slurm, found 'none'"),
        (("--address", "auto"), "--address: expected --executor ray beside it, found 'local'"),
        (("--partition", "cpu"), "--partition: expected --executor slurm beside it, found 'local'"),
        (("--workers", "0"), "workers: expected at least 1, found 0"),
        (("--threads", "0"), "--threads: expected at least 1, found 0"),
        (("--maps", "nowhere"), "unknown map set 'nowhere'; available: "),
        (
            ("--partners", "co-planning=stubborn"),
            "--partners: expected partners of other names than co-planning, found 'co-planning'",
        ),
        (("--partners", "kind"), "unknown kind of partner 'kind'; available: erratic, follower, slow, stubborn"),
        (("--configurations", "3"), "--configurations: expected a multiple of 4 from 4 to 336, found 3"),
        (("--partners", "p=proxy:nowhere"), "nowhere: expected a checkpoint folder with config.json and"),
    ],
)
def test_a_wrong_call_is_one_line(made, tmp_path, capsys, monkeypatch, flags, message):
    monkeypatch.setitem(sys.modules, "ray", None)
    monkeypatch.chdir(tmp_path)
    assert sweep(made, tmp_path / "out", *flags) == 2
    assert re.sub(rf"^{re.escape(str(tmp_path))}/", "", told(capsys)).startswith(message)
    assert not (tmp_path / "out").exists()


def test_a_folder_of_something_else_is_refused(made, tmp_path, capsys):
    assert main(["sweep", "--out", str(tmp_path), "--collect"]) == 2
    assert told(capsys) == (
        f"{tmp_path / 'plan.json'}: expected the plan of a sweep (copolicy-eval sweep), found no such file"
    )
    assert main(["sweep", "--out", str(tmp_path)]) == 2
    assert told(capsys) == "--runs: expected at least one folder with training runs, or --collect, found 'none'"
    (tmp_path / "sweep.md").write_text("my notes", encoding="utf-8")
    assert sweep(made, tmp_path) == 2
    assert told(capsys).startswith(f"{tmp_path / 'sweep.md'}: expected a path that does not exist yet")


@pytest.mark.usefixtures("peg")
def test_a_second_task_is_swept(tmp_path):
    peg = {"observation_features": "absolute", "mirror": False, "permute_obstacles": False, "task": "peg"}
    save_run(tmp_path / "codp-h" / "seed_0", **peg)
    call = ["sweep", "--runs", f"P={tmp_path / 'codp-h'}", "--limit", "2", "--step-limit", "24"]
    assert main([*call, "--out", str(tmp_path / "out")]) == 0
    (row,) = table(tmp_path / "out")["tasks"]
    assert row["maps"] == next(iter(get_task("peg").scenario_sets))
