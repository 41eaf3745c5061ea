"""Paired comparison of results: known numbers, and refusals of what cannot be compared."""

import json
import math
from typing import Any

import numpy as np
import pytest
from scipy import stats

from copolicy.dataset.scenarios import base_name
from copolicy.evaluate.cli import main
from copolicy.evaluate.comparison.paired import clustered_mean, mcnemar_exact, welch


def _write(path, successes, *, weights="", seconds=20.0, force=0.1, study="coplan", partner=None, **settings):
    """A result: episode k is on map k, with 1 to 3 obstacles in turn."""
    rows = [
        {
            "map_index": k, "map_id": f"holdout-{k:02d}", "start_theta": 3.14, "obstacles": 1 + k % 3, "repeat": 0,
            "success": bool(success), "time_s": seconds + k, "interaction_mean": force, "interaction_p95": 2 * force,
            **({"partner": partner} if partner else {}),
        }
        for k, success in enumerate(successes)
    ]  # fmt: skip
    content = {
        "study": study,
        "label": "in simulation",
        "policy": {"weights_sha256": weights or path.stem},
        "settings": {"maps": "holdout", "actions_per_plan": 8, "hold": 3, "step_limit": 2000, "seed": 0, **settings},
        "episodes": rows,
    }
    path.write_text(json.dumps(content), encoding="utf-8")
    return str(path)


def _compare(capsys, *flags) -> Any:
    status = main(["compare", *flags, "--json"])
    captured = capsys.readouterr()
    return json.loads(captured.out) if status == 0 else (status, captured.err.strip())


def test_two_results_are_compared_pair_by_pair(tmp_path, capsys):
    # Both succeed on 5 maps, only the first on 6, only the second on 1.
    one = _write(tmp_path / "a.json", [1] * 11 + [0], seconds=10)
    other = _write(tmp_path / "b.json", [1] * 5 + [0] * 6 + [1], seconds=12, force=0.3, seed=7, device="cuda")
    found = _compare(capsys, one, other)
    assert found["methods"]["a"]["success"]["mean"] == pytest.approx(11 / 12)
    assert found["methods"]["a"]["success"]["standard_error_of"] == "binomial, one run"
    assert found["methods"]["a"]["success"]["standard_error"] == pytest.approx(math.sqrt(11 / 144 / 12))
    (difference,) = found["differences"]
    assert (difference["first"], difference["second"]) == ("a", "b")
    assert difference["success"]["mean"] == pytest.approx(5 / 12)
    assert difference["mcnemar"] == {"only_first": 6, "only_second": 1, "p": pytest.approx(0.125)}
    assert difference["time_s"] == {
        "mean": -2.0, "standard_error": 0.0, "bootstrap_95": [-2.0, -2.0], "pairs": 5, "maps": 5
    }  # fmt: skip
    assert difference["interaction_mean"]["mean"] == pytest.approx(-0.2)
    low, high = difference["success"]["bootstrap_95"]
    # Twelve differences of +1 (6), 0 (5), -1 (1): standard error 0.18, and a resample moves in twelfths.
    assert difference["success"]["standard_error"] == pytest.approx(
        np.std([1] * 6 + [0] * 5 + [-1]) / 12**0.5, rel=0.03
    )
    assert low == pytest.approx(5 / 12 - 1.96 * 0.18, abs=0.09)
    assert high == pytest.approx(5 / 12 + 1.96 * 0.18, abs=0.09)
    assert difference["between_runs"] is None
    assert list(difference["parts"]) == ["1 obstacle", "2 obstacles", "3 obstacles"]
    assert difference["parts"]["1 obstacle"]["success"]["pairs"] == 4


def test_runs_of_a_method_are_averaged_and_their_spread_is_between_seeds(tmp_path, capsys):
    ours = [_write(tmp_path / f"h{seed}.json", [1] * n + [0] * (10 - n)) for seed, n in enumerate((8, 9, 10))]
    theirs = [_write(tmp_path / f"c{seed}.json", [1] * n + [0] * (10 - n)) for seed, n in enumerate((5, 6, 7))]
    found = _compare(capsys, "--method", "CoDP-H", *ours, "--method", "CoDP", *theirs)
    success = found["methods"]["CoDP-H"]["success"]
    assert success["mean"] == pytest.approx(0.9)
    assert success["max"] == 1.0
    assert success["standard_error"] == pytest.approx(0.1 / math.sqrt(3))
    assert (success["standard_error_of"], success["runs"], success["episodes"]) == ("between runs", 3, 10)
    assert found["methods"]["CoDP-H"]["per_run_success"] == [0.8, 0.9, 1.0]
    (difference,) = found["differences"]
    assert difference["success"]["mean"] == pytest.approx(0.3)
    assert difference["mcnemar"] is None
    expected = stats.ttest_ind([0.8, 0.9, 1.0], [0.5, 0.6, 0.7], equal_var=False)
    assert difference["between_runs"]["p"] == pytest.approx(expected.pvalue)  # pyright: ignore


def test_the_table_is_markdown(tmp_path, capsys):
    one = _write(tmp_path / "a.json", [1, 1, 1, 0])
    other = _write(tmp_path / "b.json", [1, 0, 1, 0])
    table = tmp_path / "table.md"
    assert main(["compare", one, other, "--out", str(table)]) == 0
    text = capsys.readouterr().out
    assert table.read_text(encoding="utf-8") == text
    assert "| a | 1 | 75.0 ± 21.7 (75.0) | 21.00 |" in text
    assert "| a - b | +25.0 (" in text
    assert "in simulation" in text
    assert main(["compare", one, other, "--out", str(table)]) == 2
    assert "nothing was overwritten" in capsys.readouterr().err
    assert main(["compare", one, other, "--out", str(table), "--overwrite"]) == 0


def test_files_of_one_name_are_told_apart_by_their_folders(tmp_path, capsys):
    for name in ("x", "y"):
        (tmp_path / name).mkdir()
    files = [_write(tmp_path / name / "eval.json", [1, 0], weights=name) for name in ("x", "y")]
    assert list(_compare(capsys, *files)["methods"]) == ["x/eval", "y/eval"]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"actions_per_plan": 1}, "expected actions_per_plan 8 as in {a}, found 1"),
        ({"maps": "unseen"}, "expected maps holdout as in {a}, found unseen"),
        ({"orientations": True}, "expected orientations None as in {a}, found True"),
        ({"study": "partner"}, "expected the study 'coplan' as in {a}, found 'partner'"),
    ],
)
def test_another_protocol_is_refused(tmp_path, capsys, changed, message):
    one = _write(tmp_path / "a.json", [1, 0])
    other = _write(tmp_path / "b.json", [1, 0], **changed)
    assert _compare(capsys, one, other) == (2, f"copolicy-eval: {other}: {message.format(a=one)}")


def test_other_partners_are_named_without_their_habits(tmp_path, capsys):
    kinds = {"slow": {"speed": 26.0}, "stubborn": {"speed": 48.0}}
    one = _write(tmp_path / "a.json", [1, 0], study="partner", partner="slow", partners=kinds)
    other = _write(
        tmp_path / "b.json", [1, 0], study="partner", partner="slow", partners={**kinds, "slow": {"speed": 20.0}}
    )
    assert _compare(capsys, one, other)[1] == (
        f"copolicy-eval: {other}: expected partners the same partners as in {one}, found others: slow"
    )


def test_other_episodes_are_refused(tmp_path, capsys):
    one = _write(tmp_path / "a.json", [1, 0, 1])
    other = _write(tmp_path / "b.json", [1, 0])
    status, error = _compare(capsys, one, other)
    assert status == 2
    assert error == (
        f"copolicy-eval: {other}: expected the episodes of {one}, found others, such as (2, 'holdout-02', 3.14, '', 0)"
    )


def test_the_same_training_twice_is_no_second_seed(tmp_path, capsys):
    one = _write(tmp_path / "a.json", [1, 0], weights="f" * 64)
    again = _write(tmp_path / "b.json", [1, 1], weights="f" * 64, seed=1)
    other = _write(tmp_path / "c.json", [1, 1])
    status, error = _compare(capsys, "--method", "ours", one, again, "--method", "theirs", other)
    assert status == 2
    assert error == f"copolicy-eval: {again}: expected another training than {one}, found the same weights {'f' * 12}"


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("{", "invalid JSON (Expecting property name enclosed in double quotes: line 1 column 2 (char 1))"),
        ("[]", "a JSON list"),
        ("{}", "object missing required field `study`"),
        ('{"study": "coplan", "label": "", "policy": {}, "settings": {}, "episodes": [{"map_index": 0}]}',
         "episodes without map_id, start_theta, obstacles, repeat, success, time_s, interaction_mean"),
        ('{"study": "coplan", "label": "", "policy": {}, "settings": {}, "episodes": []}', None),
    ],
)  # fmt: skip
def test_what_is_no_result_is_refused(tmp_path, capsys, text, found):
    one = _write(tmp_path / "a.json", [1, 0])
    other = tmp_path / "b.json"
    other.write_text(text, encoding="utf-8")
    what = "a result of copolicy-eval coplan or partner" if found else "at least one episode, and each once"
    expected = f"copolicy-eval: {other}: expected {what}, found {found or '0, 0 distinct'}"
    assert _compare(capsys, one, str(other)) == (2, expected)


def test_one_method_is_nothing_to_compare(tmp_path, capsys):
    one = _write(tmp_path / "a.json", [1, 0])
    assert _compare(capsys, one) == (
        2,
        "copolicy-eval: FILE: expected at least two files or methods to compare, found 1",
    )
    status, error = _compare(capsys, one, "--method", "b")
    assert (status, error) == (2, "copolicy-eval: --method: expected a name and at least one file, found ['b']")


def test_orientations_of_a_map_are_drawn_together():
    assert base_name("unseen-07-270deg") == base_name("unseen-07-0deg") == "unseen-07"
    assert base_name("holdout-07") == "holdout-07"
    rng = np.random.default_rng(0)
    effect = np.repeat(rng.normal(size=20), 8)  # 20 maps, 8 equal episodes each
    narrow = clustered_mean(effect, list(range(160)))["bootstrap_95"]
    wide = clustered_mean(effect, np.repeat(np.arange(20), 8).tolist())["bootstrap_95"]
    assert (wide[1] - wide[0]) / (narrow[1] - narrow[0]) == pytest.approx(math.sqrt(8), rel=0.15)
    half = clustered_mean(np.array([1.0, math.nan]), ["a", "b"])
    assert half == {"mean": 1.0, "standard_error": None, "bootstrap_95": None, "pairs": 1, "maps": 1}


def test_mcnemar_is_the_binomial_test_of_the_discordant_pairs():
    assert mcnemar_exact([True, True], [True, True]) == {"only_first": 0, "only_second": 0, "p": 1.0}
    ten = mcnemar_exact([True] * 10 + [False], [False] * 10 + [True])
    assert ten["p"] == pytest.approx(2 * 12 / 2**11)


def test_runs_without_spread_have_no_t_test():
    assert welch([0.5, 0.5], [0.7, 0.7]) is None
    assert welch([0.5], [0.7, 0.8]) is None
