import json

import pytest

from copolicy.dataset.command_line.commands import add_command, add_group, command_parser, run
from copolicy.dataset.exceptions import FileFormatError, RunError


def _parser(handler):
    parser, commands = command_parser("tool", "A tool.")
    add_command(commands, "do", handler, "does it", "tool do")
    return parser


def test_a_summary_is_printed_for_people_or_as_json(capsys):
    parser = _parser(lambda arguments: {"episodes": 3, "share": 0.123456})
    assert run(parser, ["do"]) == 0
    assert capsys.readouterr().out == "episodes  3\nshare     0.1235\n"
    assert run(parser, ["do", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"episodes": 3, "share": 0.123456}


@pytest.mark.parametrize(
    ("error", "status"), [(FileFormatError("a.mcap", "an MCAP file", "text"), 2), (RunError("no"), 1)]
)
def test_an_error_is_one_line_and_decides_the_status(capsys, error, status):
    def handler(arguments):
        raise error

    assert run(_parser(handler), ["do"]) == status
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == f"tool: {error}\n"
    with pytest.raises(type(error)):
        run(_parser(handler), ["do", "--debug"])


def test_a_missing_file_is_one_line(capsys):
    def handler(arguments):
        open("no-such-file", encoding="utf-8")  # noqa: SIM115

    assert run(_parser(handler), ["do"]) == 1
    assert capsys.readouterr().err == "tool: no-such-file: No such file or directory\n"


def test_a_finding_sets_the_status(capsys):
    assert run(_parser(lambda arguments: {"found": 1, "exit_status": 1}), ["do"]) == 1
    assert capsys.readouterr().out == "found  1\n"


def test_help_shows_an_example(capsys):
    with pytest.raises(SystemExit) as stop:
        run(_parser(lambda arguments: {}), ["do", "--help"])
    assert stop.value.code == 0
    assert "example:\n  tool do" in capsys.readouterr().out


def test_an_unknown_flag_is_reported_by_its_command(capsys):
    with pytest.raises(SystemExit) as stop:
        run(_parser(lambda arguments: {}), ["do", "--pilots", "keyboard"])
    assert stop.value.code == 2
    assert capsys.readouterr().err == (
        "usage: tool do [-h] [--json] [--debug]\ntool do: error: unrecognized arguments: --pilots keyboard\n"
    )


@pytest.mark.parametrize("argv", [["--ver"], ["do", "--js"], ["of", "it", "--deb"]])
def test_a_flag_cannot_be_abbreviated(capsys, argv):
    """It would change its meaning with each new flag."""
    parser, commands = command_parser("tool", "A tool.")
    add_command(commands, "do", lambda arguments: {}, "does it", "tool do")
    add_command(add_group(commands, "of", "steps", "Steps.", ["tool of it"]), "it", lambda arguments: {}, "", "")
    with pytest.raises(SystemExit) as stop:
        run(parser, argv)
    assert stop.value.code == 2
    assert capsys.readouterr().out == ""


def test_nothing_is_printed_as_none(capsys):
    assert run(_parser(lambda arguments: {"left_out": [], "physics": {}}), ["do"]) == 0
    assert capsys.readouterr().out == "left_out  none\nphysics   none\n"
