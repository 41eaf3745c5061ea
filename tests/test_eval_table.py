"""The co-planning table: its statistics, results that are kept and used again, and refusals."""

import json
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from policy_runs import save_run

from copolicy.dataset.policies.training_run import find_policy_folder
from copolicy.dataset.task import get_task
from copolicy.evaluate.cli import main
from copolicy.evaluate.coplan import study
from copolicy.evaluate.coplanning_table import evaluations
from copolicy.evaluate.coplanning_table.training_runs import read_trained_methods
from copolicy.train.processor_files import processors_sha256

SHORT = ("--limit", "4", "--step-limit", "24")


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """Two methods with two seeds each."""
    folder = tmp_path_factory.mktemp("methods")
    for seed in (1, 0):
        save_run(folder / "codp-h" / f"seed_{seed}" / "training", seed=seed)
        save_run(folder / "bc" / f"seed_{seed}" / "training", "bc_lstm_gmm", seed)
    return folder


@pytest.fixture(scope="module")
def evaluated(made, tmp_path_factory) -> Path:
    """These methods after their evaluation."""
    folder = tmp_path_factory.mktemp("evaluated") / "methods"
    shutil.copytree(made, folder, symlinks=True)
    assert _table(folder) == 0
    return folder


@pytest.fixture
def methods(made, tmp_path) -> Path:
    """A copy without results."""
    return Path(shutil.copytree(made, tmp_path / "methods", symlinks=True))


@pytest.fixture
def results(evaluated, tmp_path) -> Path:
    """A copy with results."""
    return Path(shutil.copytree(evaluated, tmp_path / "evaluated", symlinks=True))


def _table(folder: Path, *flags: str, limits: tuple[str, ...] = SHORT) -> int:
    runs = (f"CoDP-H={folder / 'codp-h'}", f"BC={folder / 'bc'}")
    return main(["table", "coplanning", "--runs", *runs, "--out", str(folder / "out"), *limits, *flags, "--json"])


def _read(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "out" / "table.json").read_text(encoding="utf-8"))


def _files(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and "checkpoints" not in path.parts
    }


def _set_successes(folder: Path, method: str, seed: int, maps: str, successes: list[int]) -> None:
    path = folder / method / f"seed_{seed}" / "training" / "coplanning" / f"{maps}.json"
    result = json.loads(path.read_text(encoding="utf-8"))
    for row, success in zip(result["episodes"], successes, strict=True):
        row["success"], row["time_s"], row["interaction_mean"] = bool(success), 10.0 + 2 * seed, 0.25
    path.write_text(json.dumps(result), encoding="utf-8")


def test_results_lie_beside_the_runs_and_tables_in_the_folder(evaluated):
    kept = sorted(path.relative_to(evaluated).as_posix() for path in evaluated.rglob("coplanning/*.json"))
    assert kept == [
        f"{method}/seed_{seed}/training/coplanning/{maps}.json"
        for method in ("bc", "codp-h")
        for seed in (0, 1)
        for maps in ("holdout", "unseen")
    ]
    assert sorted(path.name for path in (evaluated / "out").iterdir()) == [
        "table.csv", "table.json", "table.md", "table.png",
    ]  # fmt: skip
    table = _read(evaluated)
    assert [run["seed"] for run in table["methods"][0]["runs"]] == [0, 1]
    assert [row["actions_per_chunk"] for row in table["methods"]] == [8, 1]
    assert [row["samples"] for row in table["methods"]] == [800, 800]
    assert table["methods"][0]["maps"]["holdout"]["episodes"] == 8
    assert table["left_out"] == []
    text = (evaluated / "out" / "table.md").read_text(encoding="utf-8")
    assert text.startswith("# Co-planning with simulated pairs\n")
    assert "no person took part" in text
    assert text.count("biased upward") == 2  # under the table, and in the definition


def test_an_evaluation_is_that_of_the_coplan_command(evaluated, tmp_path, capsys):
    run = evaluated / "bc" / "seed_1" / "training"
    out = tmp_path / "eval.json"
    assert main(["coplan", "--policy", str(run), "--maps", "unseen", "--out", str(out), *SHORT]) == 0
    alone = json.loads(out.read_text(encoding="utf-8"))
    kept = json.loads((run / "coplanning" / "unseen.json").read_text(encoding="utf-8"))
    assert kept["episodes"] == alone["episodes"]
    assert kept["settings"] == alone["settings"]


def test_a_second_call_changes_nothing(results, capsys):
    before = _files(results)
    assert _table(results) == 0
    assert json.loads(capsys.readouterr().out)["new_evaluations"] == 0
    table = _read(results)
    # Only the folders of the runs have changed with the copy.
    assert _files(results).keys() == before.keys()
    first = _files(results)
    assert _table(results) == 0
    assert _files(results) == first
    assert table["methods"][0]["maps"]["unseen"]["per_seed"] == [0.0, 0.0]


def test_statistics_of_known_successes(results):
    for seed, successes in enumerate(([1, 1, 1, 0], [1, 1, 0, 0])):
        _set_successes(results, "codp-h", seed, "unseen", successes)
    for seed, successes in enumerate(([0, 1, 0, 0], [0, 0, 0, 1])):
        _set_successes(results, "bc", seed, "unseen", successes)
    assert _table(results) == 0
    table = _read(results)
    first, second = (row["maps"]["unseen"] for row in table["methods"])
    assert (first["best"], first["mean"], first["per_seed"]) == (0.75, 0.625, [0.75, 0.5])
    assert first["standard_error"] == pytest.approx(np.std([0.75, 0.5], ddof=1) / math.sqrt(2))
    assert (first["standard_error_of"], first["successes"], first["episodes"]) == ("between runs", 5, 8)
    assert first["time_s"] == {
        "mean": 11.0, "standard_error": pytest.approx(1.0), "max": 12.0, "runs": 2
    }  # fmt: skip
    assert second["mean"] == 0.25
    assert first["published_mean"] == [82, 252]
    (difference,) = table["differences"]
    assert (difference["reference"], difference["method"]) == ("CoDP-H", "BC")
    paired = difference["maps"]["unseen"]
    # Of the four maps, the means over seeds are 1, 1, 0.5, 0 and 0, 0.5, 0, 0.5.
    assert paired["mean"] == pytest.approx(0.375)
    assert paired["standard_error"] == pytest.approx(np.std([1, 0.5, 0.5, -0.5]) / 2, rel=0.03)
    assert paired["between_seeds"]["p"] > 0
    text = (results / "out" / "table.md").read_text(encoding="utf-8")
    assert "| CoDP-H | 2 | 0.0 / 0.0 ± 0.0 | 75.0 / 62.5 ± 12.5 | 78.6 / 77.4 | 40.5 / 32.5 |" in text
    assert "| BC | 2 | 0.0 / 0.0 ± 0.0 | 25.0 / 25.0 ± 0.0 | 60.7 / 55.2 | 19.0 / 17.1 |" in text
    lines = (results / "out" / "table.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 5
    assert lines[2].startswith("CoDP-H,unseen,simulated pairs,copolicy,small,local/pairs,10,8,2,8,5,0.75,0.625,")


def test_one_seed_has_a_binomial_standard_error_and_says_so(results):
    shutil.rmtree(results / "bc" / "seed_1")
    _set_successes(results, "bc", 0, "holdout", [1, 1, 1, 0])
    assert _table(results) == 0
    text = (results / "out" / "table.md").read_text(encoding="utf-8")
    error = 100 * math.sqrt(0.75 * 0.25 / 4)
    assert f"| BC | 1 | 75.0 / 75.0 ± {error:.1f} (binomial) |" in text
    assert _read(results)["differences"][0]["maps"]["holdout"]["between_seeds"] is None


def test_an_interrupted_table_continues(methods, monkeypatch, capsys):
    calls = []

    def stops(*arguments):
        calls.append(arguments)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return study.write_coplan_result(*arguments)

    monkeypatch.setattr(evaluations, "write_coplan_result", stops)
    assert _table(methods) == 130
    assert not (methods / "out").exists()
    monkeypatch.undo()
    assert _table(methods) == 0
    assert json.loads(capsys.readouterr().out)["new_evaluations"] == 5


def test_results_of_other_settings_and_weights_are_noticed(results, caplog):
    foreign = results / "bc" / "earlier.json"
    kept = results / "bc" / "seed_0" / "training" / "coplanning" / "unseen.json"
    result = json.loads(kept.read_text(encoding="utf-8"))
    result["policy"]["weights_sha256"] = "f" * 64
    foreign.write_text(json.dumps(result), encoding="utf-8")
    before = kept.read_bytes()
    assert _table(results, limits=("--limit", "4", "--step-limit", "27")) == 0
    table = _read(results)
    assert kept.read_bytes() == before
    assert table["settings"]["step_limit"] == 27
    assert f"{foreign}: left out, its weights ffffffffffff are of no run in {results / 'bc'}" in table["left_out"]
    assert f"{kept}: left out, other settings: step_limit 24, here 27" in table["left_out"]
    assert len(table["left_out"]) == 9
    assert (kept.parent / "unseen_2.json").exists()
    assert f"warning: {foreign}: left out" in caplog.text


def test_results_with_another_sampler_are_not_mixed(results):
    kept = results / "codp-h" / "seed_0" / "training" / "coplanning" / "unseen.json"
    result = json.loads(kept.read_text(encoding="utf-8"))
    result["policy"]["sampler"] = "ddpm"
    kept.write_text(json.dumps(result), encoding="utf-8")
    assert _table(results) == 0
    assert _read(results)["left_out"] == [f"{kept}: left out, other settings: sampler ddpm, here ddim"]


def test_results_with_other_processors_are_not_mixed(results):
    """The weights are the same; the result says which processors it had."""
    run = results / "codp-h" / "seed_0" / "training"
    kept = run / "coplanning" / "unseen.json"
    before = json.loads(kept.read_text(encoding="utf-8"))["policy"]["processors_sha256"]
    checkpoint = find_policy_folder(run)
    assert checkpoint is not None
    with (checkpoint / "policy_preprocessor.json").open("a", encoding="utf-8") as file:
        file.write("\n")
    assert _table(results) == 0
    after = processors_sha256(checkpoint)
    left_out = _read(results)["left_out"]
    assert f"{kept}: left out, other settings: processors_sha256 {before}, here {after}" in left_out
    assert len(left_out) == 2  # of both map sets


def test_results_of_the_coplan_command_are_used(methods, capsys):
    run = methods / "bc" / "seed_0" / "training"
    out = run.parent / "mine.json"
    assert main(["coplan", "--policy", str(run), "--maps", "unseen", "--out", str(out), *SHORT]) == 0
    shutil.rmtree(methods / "bc" / "seed_1")
    capsys.readouterr()
    flags = ("--runs", str(methods / "bc"), "--maps", "unseen", "--out", str(methods / "out"), *SHORT, "--json")
    assert main(["table", "coplanning", *flags]) == 0
    assert json.loads(capsys.readouterr().out)["new_evaluations"] == 0
    table = _read(methods)
    assert table["methods"][0]["method"] == "bc_lstm_gmm paper"
    assert table["methods"][0]["runs"][0]["results"] == {"unseen": str(out)}
    assert table["differences"] == []


def test_the_published_percentages_are_the_papers():
    percent = {
        method.name: [
            round(100 * n / of, 2) for maps in ("unseen", "holdout") for n, of in (method.best[maps], method.mean[maps])
        ]
        for method in get_task().studies.published
    }
    assert percent == {
        "CoDP-H": [40.48, 32.54, 78.57, 77.38],
        "CoDP": [32.14, 28.97, 72.62, 67.86],
        "BC-LSTM-GMM": [19.05, 17.06, 60.71, 55.16],
        "Co-GAIL": [25.00, 22.22, 47.62, 39.29],
        "VRNN": [22.62, 19.44, 22.62, 20.24],
    }


def _refused(capsys, *runs: Path | str, out: Path) -> str:
    assert main(["table", "coplanning", "--runs", *map(str, runs), "--out", str(out), *SHORT]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert lines[-1].startswith("copolicy-eval: ")
    return lines[-1].removeprefix("copolicy-eval: ")


def test_folders_without_runs_are_refused(results, tmp_path, capsys):
    expected = "expected a folder with training runs (checkpoints with config.json and model.safetensors)"
    out = tmp_path / "out"
    assert _refused(capsys, tmp_path / "none", out=out) == f"{tmp_path / 'none'}: {expected}, found no such folder"
    (empty := tmp_path / "empty").mkdir()
    assert _refused(capsys, empty, out=out) == f"{empty}: {expected}, found none"
    alone = results / "bc" / "seed_0" / "training"
    shutil.rmtree(alone / "checkpoints")
    found = f"results without their policy, such as {alone / 'coplanning' / 'holdout.json'}"
    assert _refused(capsys, alone, out=out) == f"{alone}: {expected}, found {found}"
    assert not out.exists()


def test_runs_of_one_method_differ_in_their_seed_alone(methods, tmp_path, capsys):
    bc, first = methods / "bc", methods / "bc" / "seed_0" / "training"
    alone = "runs of one method differ in their seed alone"

    def refused(**settings: Any) -> str:
        other = save_run(bc / "seed_2", **{"policy": "bc_lstm_gmm", "seed": 2, **settings})
        line = _refused(capsys, bc, out=tmp_path / "out")
        shutil.rmtree(other)
        return line.removeprefix(f"{other}: ")

    assert refused(seed=0, weights=7) == f"expected another training seed than {first}, found seed 0 too"
    same = refused(weights=0)
    assert same.startswith(f"expected another training than {first}, found the same weights ")
    assert refused(reached=50) == f"expected steps 100, as {first}: {alone}, found 50"
    assert refused(fps=30.0) == f"expected frames a second 10, as {first}: {alone}, found 30"
    assert refused(preset="scan") == f"expected preset paper, as {first}: {alone}, found scan"
    assert refused(policy="copolicy") == f"expected type bc_lstm_gmm, as {first}: {alone}, found copolicy"
    assert refused(min_deviation=0.1) == f"expected min_deviation 0.0001, as {first}: {alone}, found 0.1"


def test_a_setting_that_an_earlier_version_lacked_has_its_default(methods, tmp_path, capsys):
    bc = methods / "bc"
    config = bc / "seed_0" / "training" / "checkpoints" / "last" / "pretrained_model" / "config.json"
    entries = json.loads(config.read_text(encoding="utf-8"))
    del entries["masked_state"]
    config.write_text(json.dumps(entries), encoding="utf-8")
    assert [run.seed for run in read_trained_methods([str(bc)])[0].runs] == [0, 1]
    other = save_run(bc / "seed_2", "bc_lstm_gmm", seed=2, masked_state=["vx"])
    line = _refused(capsys, bc, out=tmp_path / "out")
    assert line.startswith(f"{other}: expected masked_state ")
    assert line.endswith("found ['vx']")


def test_names_outputs_and_rates(methods, tmp_path, capsys):
    runs = [methods / "bc" / f"seed_{seed}" for seed in (0, 1)]
    line = _refused(capsys, *runs, out=tmp_path / "out")
    assert line == "--runs: expected methods of different names; give NAME=DIR, found 'bc_lstm_gmm paper twice'"
    (out := tmp_path / "mine").mkdir()
    (out / "table.md").write_text("my notes", encoding="utf-8")
    line = _refused(capsys, runs[0], out=out)
    assert line == f"{out / 'table.md'}: expected a path that does not exist yet, found one; nothing was overwritten"
    odd = save_run(tmp_path / "odd", "bc_lstm_gmm", fps=12.0)
    line = _refused(capsys, odd, out=tmp_path / "out")
    assert "expected a divisor of 30" in line
    assert line.endswith("found 12")


def test_an_unfinished_training_and_an_exported_policy(methods, tmp_path, caplog):
    shutil.rmtree(methods / "bc")
    run = save_run(methods / "bc" / "seed_0" / "training", "bc_lstm_gmm", reached=50)
    exported = tmp_path / "exported"
    shutil.copytree(methods / "codp-h" / "seed_0" / "training" / "checkpoints" / "last" / "pretrained_model", exported)
    shutil.rmtree(methods / "codp-h")
    names = sorted(path.name for path in exported.iterdir())
    (methods / "codp-h").symlink_to(exported)
    assert _table(methods, "--maps", "unseen") == 0
    assert f"warning: {run}: the training is not finished (step 50 of 100)" in caplog.text
    table = _read(methods)
    assert "| BC (step 50 of 100) |" in (methods / "out" / "table.md").read_text(encoding="utf-8")
    # A folder for publication gets no further files.
    assert sorted(path.name for path in exported.iterdir()) == names
    (result,) = table["methods"][0]["runs"][0]["results"].values()
    assert Path(result).parent == methods / "out" / "results" / "CoDP-H"


@pytest.mark.usefixtures("peg")
def test_a_second_task_has_a_table_without_published_numbers(tmp_path):
    peg = {"observation_features": "absolute", "mirror": False, "permute_obstacles": False, "task": "peg"}
    save_run(tmp_path / "codp-h" / "seed_0", **peg)
    save_run(tmp_path / "bc" / "seed_0", "bc_lstm_gmm", **peg)
    assert _table(tmp_path) == 0
    table = _read(tmp_path)
    assert table["published"] == []
    assert table["maps"] == [next(iter(get_task("peg").scenario_sets))]
    assert "published" not in (tmp_path / "out" / "table.md").read_text(encoding="utf-8").split("##")[0]
