"""The chain of the quickstart, with quick commands: its lines, its log, and a second try after a failure."""

import json
from pathlib import Path

import pytest

from copolicy.dataset.exceptions import OutputExistsError, RunError
from copolicy.dataset.files.lock import lock
from copolicy.train.quickstart_chain import LOG_FILE, Step, remove_record, run_chain


def _rules(out: Path) -> Step:
    return Step("Print the rules", ("copolicy-dataset", "check", "--rules"), (out / "rules",))


def _recover(out: Path, folder: str) -> Step:
    return Step("Recover recordings", ("copolicy-collect", "recover", str(out / folder)), (out / "recovered",))


def test_a_line_a_step_and_everything_else_in_the_log(tmp_path, capfd):
    out = tmp_path / "out"
    (tmp_path / "recordings").mkdir()
    run_chain(out, [_rules(out), _recover(tmp_path, "recordings")])
    said = capfd.readouterr()
    assert said.out == ""
    first, *lines = said.err.splitlines()
    assert first == f"The commands' output is in {out / LOG_FILE}"
    assert [line.rpartition(": ")[0] for line in lines] == ["[1/2] Print the rules", "[2/2] Recover recordings"]
    log = (out / LOG_FILE).read_text(encoding="utf-8")
    assert "$ copolicy-dataset check --rules\ntimestamp" in log
    assert f"$ copolicy-collect recover {tmp_path / 'recordings'}\n" in log
    (out / "summary.json").touch()
    remove_record(out)
    with pytest.raises(OutputExistsError):
        run_chain(out, [_rules(out)])


def test_a_failure_shows_the_end_of_the_log_and_the_next_try_goes_on(tmp_path, capfd):
    out = tmp_path / "out"
    steps = [_rules(out), _recover(tmp_path, "missing")]
    with pytest.raises(RunError) as failure:
        run_chain(out, steps)
    assert str(failure.value) == (
        f"this command ended with status 2: copolicy-collect recover {tmp_path / 'missing'}; its output is in "
        f"{out / LOG_FILE}; the same call again continues from there"
    )
    shown = [line for line in capfd.readouterr().err.splitlines() if line.startswith("    ")]
    assert shown == [
        f"    copolicy-collect: {tmp_path / 'missing'}: expected a folder of recordings, found no such file or folder"
    ]

    (out / "rules").write_text("of the step that was done", encoding="utf-8")
    (tmp_path / "recovered").mkdir()
    (tmp_path / "missing").mkdir()
    run_chain(out, steps)
    assert "[1/2] Print the rules: done before" in capfd.readouterr().err
    assert (out / "rules").exists()
    assert not (tmp_path / "recovered").exists()  # what the failed step had left
    assert (out / LOG_FILE).read_text(encoding="utf-8").count("$ copolicy-dataset check --rules") == 1


def test_with_other_commands_it_begins_where_they_differ(tmp_path):
    out = tmp_path / "out"
    with pytest.raises(RunError):
        run_chain(out, [_rules(out), _recover(tmp_path, "missing")])
    (out / "rules").mkdir()
    other = Step("Print them otherwise", ("copolicy-dataset", "check", "--rules", "--json"), (out / "rules",))
    run_chain(out, [other])
    assert not (out / "rules").exists()


def test_a_folder_of_something_else_or_at_work_is_left_alone(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "notes.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(OutputExistsError):
        run_chain(out, [_rules(out)])
    (out / "notes.txt").unlink()
    with (out / ".quickstart.lock").open("wb") as file:
        assert lock(file)
        with pytest.raises(RunError, match="found another quickstart running in it"):
            run_chain(out, [_rules(out)])
    run_chain(out, [_rules(out)])
    assert json.loads((out / ".quickstart.json").read_text(encoding="utf-8")) == ["copolicy-dataset check --rules"]
