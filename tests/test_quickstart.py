"""The whole chain, small: a process a command from simulated pairs, one process from the original program's files."""

import json
import subprocess
import sysconfig
from pathlib import Path

from commands_here import commands_here, commands_in

from copolicy.cards.facts import DatasetFacts
from copolicy.train.quickstart import main

SMALL = ("--steps", "10", "--limit", "2", "--workers", "2")
SMALLEST = ("--steps", "2", "--limit", "1", "--workers", "1")


def _check(out: Path, summary: dict, maps: int) -> None:
    where = summary["where it is"]
    for name in ("data set", "card", "checkpoint"):
        assert Path(where[name]).exists(), name
    for path in (*where["results"].split(", "), *where["figures"].split(", ")):
        assert Path(path).is_file()
    evaluation = json.loads((out / "eval" / "holdout.json").read_text(encoding="utf-8"))
    assert evaluation["summary"]["success"]["episodes"] == maps
    assert f"({maps} episodes, one training seed)" in summary["what was reached"]["holdout"]
    assert json.loads((out / "summary.json").read_text(encoding="utf-8")) == summary
    assert not [path for path in out.rglob("*") if path.name.endswith(".part")]


def _check_lines(out: Path, said: str, steps: int) -> None:
    """A line a step; LeRobot's settings and what else the commands print are in the log."""
    lines = said.splitlines()
    assert len(lines) == 1 + steps, said
    assert [line.split("]")[0] for line in lines[1:]] == [f"[{place}/{steps}" for place in range(1, 1 + steps)]
    assert "'batch_size': 512" in (out / "quickstart.log").read_text(encoding="utf-8")


def test_the_chain_from_simulated_pairs(tmp_path, warm_python, capsys):
    out = tmp_path / "out"
    with commands_in(warm_python):
        assert main(["--json", "--out", str(out), *SMALL, "--episodes", "4"]) == 0
    printed = capsys.readouterr()
    summary, said = json.loads(printed.out), printed.err
    _check(out, summary, 2)
    assert len(list((out / "recordings").rglob("*.mcap"))) == 4
    facts = DatasetFacts.read(out / "dataset")
    assert facts.counts("source") == {"simulated": 4}
    assert "simulated pairs" in summary["what was reached"]["label"]
    assert "no person took part" in summary["what was reached"]["label"]
    assert "**No person took part.**" in (out / "dataset" / "README.md").read_text(encoding="utf-8")
    _check_lines(out, said, 6)
    assert "$ copolicy-collect simulate --episodes 4" in (out / "quickstart.log").read_text(encoding="utf-8")
    for command in summary["what to type next"].values():
        assert command.removeprefix("uv run ").split()[0] in {"copolicy-train", "copolicy-eval", "lerobot-eval"}


def test_the_chain_from_files_that_the_original_program_wrote(tmp_path, upstream, capsys):
    out = tmp_path / "out"
    # The store, because its converter took the map of episode 11 for episode 1.
    store = upstream / "examples_scripted" / "table_10Hz.zarr"
    with commands_here():
        assert main(["--json", "--out", str(out), *SMALLEST, "--upstream", str(store)]) == 0
    printed = capsys.readouterr()
    summary, said = json.loads(printed.out), printed.err
    _check(out, summary, 1)
    facts = DatasetFacts.read(out / "dataset")
    assert facts.counts("source") == {"upstream": 11}
    assert facts.successes == 10
    assert "files of the original program" in summary["what was reached"]["label"]
    assert any("map_mismatch" in flags for flags in facts.counts("quality_flags"))
    _check_lines(out, said, 5)
    assert "$ copolicy-convert upstream" in (out / "quickstart.log").read_text(encoding="utf-8")


def test_an_output_folder_in_use_is_left_alone(tmp_path):
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    program = Path(sysconfig.get_path("scripts")) / "copolicy-quickstart"
    done = subprocess.run([program, "--out", tmp_path], capture_output=True, text=True)
    assert done.returncode == 2
    assert "nothing was overwritten" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_a_command_that_fails_ends_the_chain_with_its_name(tmp_path, capfd):
    assert main(["--out", str(tmp_path / "out"), "--upstream", str(tmp_path / "nowhere"), *SMALL]) == 1
    error = capfd.readouterr().err
    assert "copolicy-quickstart: this command ended with status 2: copolicy-convert upstream" in error
    assert f"    copolicy-convert: {tmp_path / 'nowhere'}: expected " in error
    assert str(tmp_path / "out" / "quickstart.log") in error
