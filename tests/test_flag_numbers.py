"""Number flags have bounds and report them in one line."""

import re

import pytest
from command_walk import every_command

from copolicy.collect.cli import main as collect
from copolicy.dataset.command_line.commands import add_command, command_parser, run
from copolicy.dataset.command_line.flag_numbers import number, seed, whole_number, workers
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.evaluate.cli import main as evaluate
from copolicy.train.quickstart import main as quickstart


@pytest.mark.parametrize(
    ("parse", "text", "message"),
    [
        (whole_number("--n"), "0", "--n: expected at least 1, found 0"),
        (whole_number("--n"), "-3", "--n: expected at least 1, found -3"),
        (whole_number("--n"), "1.5", "--n: expected a whole number, found '1.5'"),
        (whole_number("--n"), "nan", "--n: expected a whole number, found 'nan'"),
        (whole_number("--n", 0, 9), "10", "--n: expected at most 9, found 10"),
        (seed(), "4294967296", "--seed: expected at most 4294967295, found 4294967296"),
        (seed(), "-1", "--seed: expected at least 0, found -1"),
        (workers(), "0", "--workers: expected at least 1, found 0"),
        (number("--x"), "-0.5", "--x: expected a number of at least 0, found -0.5"),
        (number("--x"), "nan", "--x: expected a number of at least 0, found nan"),
        (number("--x"), "inf", "--x: expected a finite number, found inf"),
        (number("--x", exclusive=True), "0", "--x: expected a number above 0, found 0.0"),
        (number("--x", 0, 60), "61", "--x: expected a number of at most 60, found 61.0"),
        (number("--x"), "ten", "--x: expected a number, found 'ten'"),
    ],
)
def test_a_number_out_of_bounds_is_refused(parse, text, message):
    with pytest.raises(InvalidValueError, match=f"^{re.escape(message)}$"):
        parse(text)


def test_numbers_within_the_bounds_are_accepted():
    assert [whole_number("--n", 0, 9)(text) for text in ("0", " 9 ")] == [0, 9]
    assert [number("--x", 0, 60)(text) for text in ("0", "60", "1e1")] == [0, 60, 10]
    assert seed()("4294967295") == 2**32 - 1


def test_a_number_out_of_bounds_gives_one_line_and_status_2(capsys):
    parser, commands = command_parser("tool", "A tool.")
    command = add_command(commands, "do", lambda arguments: {}, "does it", "tool do")
    command.add_argument("--n", type=whole_number("--n"))
    assert run(parser, ["do", "--n", "0"]) == 2
    assert capsys.readouterr().err == "tool: --n: expected at least 1, found 0\n"


def test_every_flag_of_every_command_that_takes_a_number_has_bounds():
    found = 0
    for command, parser in every_command().items():
        for action in parser._actions:
            assert action.type not in (int, float), f"{command} {action.option_strings}: no bounds"
            if getattr(action.type, "__module__", "") != "copolicy.dataset.command_line.flag_numbers":
                continue
            found += 1
            assert callable(action.type)
            for text in ("nan", "inf", "much", "1" + "0" * 400):
                with pytest.raises(InvalidValueError, match=f"^{action.option_strings[-1]}: expected "):
                    action.type(text)
            if action.default is not None:
                values = action.default if isinstance(action.default, list) else [action.default]
                assert [action.type(str(value)) for value in values] == values, f"{command} {action.option_strings}"
    assert found > 40


@pytest.mark.parametrize(
    ("command", "call", "message"),
    [
        (quickstart, "--steps=0", "--steps: expected at least 1, found 0"),
        (quickstart, "--episodes=-1", "--episodes: expected at least 1, found -1"),
        (quickstart, "--limit=0", "--limit: expected at least 1, found 0"),
        (quickstart, "--workers=0", "--workers: expected at least 1, found 0"),
        (quickstart, "--seed=-1", "--seed: expected at least 0, found -1"),
        (
            evaluate,
            "coplan --policy pretrained --initial-noise-scale=-1",
            "--initial-noise-scale: expected a number of",
        ),
        (evaluate, "coplan --policy pretrained --initial-noise-scale=nan", "--initial-noise-scale: expected a number"),
        (evaluate, "coplan --policy pretrained --num-inference-steps=0", "--num-inference-steps: expected at least 1"),
        (evaluate, "coplan --policy pretrained --step-limit=0", "--step-limit: expected at least 1, found 0"),
        (evaluate, "coplan --policy pretrained --fps=0", "--fps: expected at least 1, found 0"),
        (
            evaluate,
            "coplan --policy pretrained --num-inference-steps=101",
            "num_inference_steps: expected 1 to num_train_timesteps = 100, found 101",
        ),
        (collect, "simulate --episodes=0", "--episodes: expected at least 1, found 0"),
        (collect, "simulate --episodes=1 --start-noise=nan", "--start-noise: expected a number of at least 0"),
    ],
)
def test_numbers_out_of_bounds_end_a_command_before_any_work(tmp_path, capsys, command, call, message):
    out = tmp_path / ("out.json" if command is evaluate else "out")
    assert command([*call.split(), "--out", str(out)]) == 2
    said = capsys.readouterr()
    assert (said.out, len(said.err.splitlines())) == ("", 1), said.err
    assert message in said.err
    assert not list(tmp_path.iterdir())
