"""Within-subject statistics: the reconstructed robot study of the paper, known results, designs that have no test."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.evaluate.cli import main
from copolicy.evaluate.within_subject.analysis import analyse, markdown
from copolicy.evaluate.within_subject.anova import analysis_of_variance, rank_test
from copolicy.evaluate.within_subject.contrasts import holm, tukey
from copolicy.evaluate.within_subject.measurements import Measurements
from copolicy.evaluate.within_subject.mixed_logistic import mixed_logistic
from copolicy.evaluate.within_subject.power import people_needed

TRIALS = Path(__file__).parent / "data" / "robot_study" / "trials.csv"
VALUES = np.array([[8.0, 7, 6, 7], [6, 5, 3, 4], [7, 6, 4, 8], [5, 5, 2, 3], [6, 7, 5, 6]])


def measured(values: np.ndarray) -> Measurements:
    """Values `(n, k)` of people with robots a, b, ..."""
    rows = [
        {"participant": f"P{i}", "robot": "abcdefgh"[j], "value": values[i, j]} for i, j in np.ndindex(values.shape)
    ]
    return Measurements.of_rows(rows, "value", "participant", ("robot",))


@pytest.fixture(scope="module")
def robot_study() -> dict:
    return analyse(Measurements.read(TRIALS, "success", "participant", ("method", "configuration")))


def test_the_papers_analysis_of_variance_is_reproduced(robot_study):
    effects = {effect["source"]: effect for effect in robot_study["anova"]}
    assert list(effects) == ["method", "configuration", "method x configuration"]
    for source, f, df, p in (
        ("method", 3.152, [4, 20], 0.037),
        ("configuration", 7.857, [1, 5], 0.038),
        ("method x configuration", 3.170, [4, 20], 0.036),
    ):
        assert effects[source]["F"] == pytest.approx(f, abs=5e-4)
        assert effects[source]["df"] == df
        assert effects[source]["p"] == pytest.approx(p, abs=5e-4)
    assert effects["method"]["partial_eta_squared"] == pytest.approx(0.48333 / (0.48333 + 0.76667), abs=1e-4)
    assert effects["configuration"]["sphericity"] is None  # two levels
    assert effects["method"]["p"] < 0.05 < effects["method"]["p_greenhouse_geisser"]
    assert robot_study["unit_of_analysis"] == (
        "unit of analysis: the participant, n = 6; the mean of 2 rows in each condition"
    )


def test_the_simple_effect_of_bc_and_its_missing_correction(robot_study):
    pairs = {pair["at"]: pair["paired_t"] for pair in robot_study["contrasts"]["configuration at each method"]}
    assert abs(pairs["BC"]["t"]) == pytest.approx(6.325, abs=5e-4)
    assert (pairs["BC"]["df"], pairs["BC"]["p"]) == (5, pytest.approx(0.00146, abs=5e-6))
    assert pairs["BC"]["p_holm"] == pytest.approx(5 * 0.001457, abs=1e-4)  # the paper prints .001 as "adjusted"
    assert all(pairs[method]["p_holm"] > 0.05 for method in ("CoDP-H", "CoDP", "Co-GAIL", "VRNN"))


def test_the_papers_deviations_are_the_sample_deviation_over_six(robot_study):
    printed = {("Co-GAIL", "robot front"): 7.4, ("BC", "human front"): 4.30, ("CoDP-H", "robot front"): 3.40}
    cells = {(cell["method"], cell["configuration"]): cell for cell in robot_study["cells"]}
    for cell, value in printed.items():
        assert 100 * cells[cell]["sd"] / 6 == pytest.approx(value, abs=0.06)
        assert 100 * cells[cell]["standard_error"] == pytest.approx(value * np.sqrt(6), abs=0.15)


def test_one_way_is_the_model_fitted_by_least_squares():
    effects = analysis_of_variance(measured(VALUES))
    assert effects is not None
    (effect,) = effects
    n, k = VALUES.shape
    person, condition = np.repeat(np.arange(n), k), np.tile(np.arange(k), n)
    people, conditions = np.eye(n)[person], np.eye(k)[condition][:, 1:]
    residuals = [
        float(np.linalg.lstsq(design, VALUES.ravel(), rcond=None)[1][0])
        for design in (people, np.hstack((people, conditions)))
    ]
    f = ((residuals[0] - residuals[1]) / (k - 1)) / (residuals[1] / ((n - 1) * (k - 1)))
    assert effect["F"] == pytest.approx(f)
    assert effect["df"] == [3, 12]
    assert effect["p"] == pytest.approx(stats.f.sf(f, 3, 12))
    assert 1 / 3 <= effect["epsilon"] <= 1
    assert effect["p"] < effect["p_greenhouse_geisser"] < 0.05
    assert effect["sphericity"]["test"] == "Mauchly"


def test_two_factors_are_those_of_pingouin():
    """Of pingouin 0.7.0: rm_anova(..., within=["robot", "place"], effsize="ng2"), whose sphericity is that of R."""
    i, j, k = np.indices((8, 3, 2))
    values = ((7 * i + 5 * j + 3 * k + i * j * k) % 11).astype(float)
    rows = [
        {"p": f"P{i}", "robot": "abc"[j], "place": "xy"[k], "v": values[i, j, k]} for i, j, k in np.ndindex(8, 3, 2)
    ]
    effects = analysis_of_variance(Measurements.of_rows(rows, "v", "p", ("robot", "place")))
    assert effects is not None
    for effect, (source, f, df, p, epsilon, sphericity, generalized) in zip(
        effects,
        (
            ("robot", 0.02811244979919679, [2, 14], 0.9723337689385246, 0.7270115616425505,
             (0.6245060563539298, 0.2435622421323593), 0.0010147133434804667),
            ("place", 0.007092198581560383, [1, 7], 0.9352432068643838, 1.0, None, 0.00016926201760325224),
            ("robot x place", 0.2837055417700579, [2, 14], 0.7572157144314443, 0.8337931034482756,
             (0.8006617038875108, 0.5132715225986326), 0.016319733555370523),
        ),
        strict=True,
    ):  # fmt: skip
        assert (effect["source"], effect["df"]) == (source, df)
        assert (effect["F"], effect["p"], effect["epsilon"]) == pytest.approx((f, p, epsilon))
        assert effect["generalized_eta_squared"] == pytest.approx(generalized)
        found = effect["sphericity"]
        assert (found and (found["W"], found["p"])) == (sphericity and pytest.approx(sphericity))
    (effect,) = analysis_of_variance(measured(VALUES)) or []
    assert (effect["F"], effect["epsilon"]) == pytest.approx((8.405063291139244, 0.6539872157602429))
    assert effect["generalized_eta_squared"] == pytest.approx(0.3132075471698114)
    assert (effect["sphericity"]["W"], effect["sphericity"]["p"]) == pytest.approx(
        (0.44357545751958766, 0.8296887750296836)
    )


def test_two_conditions_are_a_paired_t_test():
    two = VALUES[:, 1:3]
    expected = stats.ttest_rel(two[:, 0], two[:, 1])
    effects = analysis_of_variance(measured(two))
    assert effects is not None
    assert effects[0]["F"] == pytest.approx(expected.statistic**2)
    assert effects[0]["p"] == pytest.approx(expected.pvalue)
    (pair,) = tukey(two, ("a", "b"))
    assert pair["difference"] == pytest.approx(2.0)
    assert pair["tukey"]["p"] == pytest.approx(expected.pvalue, rel=1e-3)
    interval = expected.confidence_interval(0.95)
    assert pair["tukey"]["interval_95"] == pytest.approx([interval.low, interval.high], rel=1e-3)
    assert len(tukey(VALUES, "abcd")) == 6


def test_what_cannot_be_tested_is_not():
    assert analysis_of_variance(measured(VALUES[:1])) is None
    assert analysis_of_variance(measured(np.ones((4, 3)))) is None
    rounded = np.where(np.random.default_rng(0).random((4, 3)) < 0.5, np.nextafter(0.1, 1), 0.1)
    assert analysis_of_variance(measured(rounded)) is None  # equal but for rounding
    assert analysis_of_variance(measured(np.arange(4.0)[:, None] + [[0.0, 1, 2]])) is None  # the same for everybody
    assert tukey(np.ones((4, 2)), "ab")[0] == {"first": "a", "second": "b", "difference": 0.0, "tukey": None}
    assert rank_test(np.ones((4, 3))) is None
    assert rank_test(VALUES)["p"] == pytest.approx(stats.friedmanchisquare(*VALUES.T).pvalue)  # pyright: ignore
    assert rank_test(VALUES[:, 1:3])["test"] == "Wilcoxon signed rank"  # pyright: ignore
    nobody = Measurements.of_rows([{"p": "P1", "r": "a", "v": 1.0}, {"p": "P2", "r": "b", "v": 1.0}], "v", "p", ("r",))
    assert (analyse(nobody)["anova"], nobody.left_out) == (None, ("P1", "P2"))


def test_rank_tests_are_recommended_where_residuals_are_not_normal():
    assert analyse(measured(VALUES))["recommended"] == "anova"
    skewed = np.random.default_rng(0).exponential(size=(40, 3)) ** 3
    assert analyse(measured(skewed))["recommended"] == "rank tests"


def test_the_bootstrap_draws_units_with_all_their_conditions():
    """The difference within units varies little although units differ much; the order of conditions does not matter."""
    rng = np.random.default_rng(2)
    units = rng.normal(scale=10, size=30)
    values = np.column_stack((units + 1, units + rng.normal(scale=0.5, size=30)))
    (pair,) = analyse(measured(values))["contrasts"]["robot"]
    low, high = pair["bootstrap_95"]
    assert low < pair["difference"] < high
    assert high - low < 0.6
    error = np.std(values[:, 0] - values[:, 1], ddof=1) / np.sqrt(30)
    assert high - low == pytest.approx(2 * 1.96 * error, rel=0.15)
    (mirrored,) = analyse(measured(values[:, ::-1]))["contrasts"]["robot"]
    np.testing.assert_allclose(mirrored["bootstrap_95"], [-high, -low], atol=0.02)


def test_holm_covers_the_contrasts_of_one_question():
    tests: list[dict | None] = [{"p": 0.01}, None, {"p": 0.04}, {"p": 0.03}]
    holm(tests)
    assert [test["p_holm"] for test in tests if test] == pytest.approx([0.03, 0.06, 0.06])
    more: list[dict | None] = [{"p": p} for p in (0.2, 0.01, 0.04, 0.03, 0.9)]
    holm(more)  # expected: statsmodels 0.15's multipletests
    assert [test["p_holm"] for test in more if test] == pytest.approx([0.4, 0.05, 0.12, 0.12, 0.9])


def test_people_without_every_condition_are_left_out_and_named(tmp_path):
    path = tmp_path / "trials.csv"
    path.write_text("who,robot,time\nA,x,1\nA,y,2\nB,x,3\nB,y,\nC,x,5\nC,y,7\nC,y,9\n", encoding="utf-8")
    found = Measurements.read(path, "time", "who", ("robot",))
    assert (found.units, found.left_out, found.rows_per_cell) == (("A", "C"), ("B",), (1, 2))
    np.testing.assert_allclose(found.values, [[1, 2], [5, 8]])
    assert found.description.endswith("left out without a value in every condition: B")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "no rows"),
        ("participant,method\nA,x\n", "no column success"),
        ("participant,method,success\nA,x,maybe\n", "expected a number for success in line 2, found 'maybe'"),
        ("participant,method,success\nA,,1\n", "no method in line 2"),
        ("participant,method,success\nA,x,1\nB,y,1\n", "expected a participant with success in every cell of method"),
    ],
)
def test_a_bad_table_is_one_line(tmp_path, text, problem):
    path = tmp_path / "t.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileFormatError, match=problem):
        Measurements.read(path, "success", "participant", ("method",))


def simulated_trials(effect: float, seed: int = 0) -> list[dict]:
    """Successes of 12 people on 10 maps with two robots, whose log odds differ by `effect`."""
    rng = np.random.default_rng(seed)
    people, maps = rng.normal(0, 1.5, 12), rng.normal(0, 1.0, 10)
    rows = []
    for i, j, robot in np.ndindex(12, 10, 2):
        p = 1 / (1 + np.exp(-(people[i] + maps[j] + effect * robot)))
        rows.append({"participant": f"P{i}", "map_id": f"m{j}", "robot": "ab"[robot], "success": rng.random() < p})
    return rows


def test_the_mixed_model_finds_the_effect_within_people_and_maps():
    fit = mixed_logistic(simulated_trials(2.0), "robot", ("participant", "map_id"))
    assert fit is not None
    b = fit["methods"]["b"]
    assert abs(b["log_odds"] - 2.0) < 2 * b["standard_error"]
    assert b["p"] < 0.001
    assert b["interval_95"][0] > 1
    people, maps = (fit["random_intercepts"][name] for name in ("participant", "map_id"))
    assert (people["levels"], maps["levels"]) == (12, 10)
    null = mixed_logistic(simulated_trials(0.0, 1), "robot", ("participant", "map_id"))
    assert null is not None
    assert null["methods"]["b"]["p"] > 0.05
    assert mixed_logistic([{**row, "success": True} for row in simulated_trials(0.0)], "robot", ("map_id",)) is None
    with pytest.raises(InvalidValueError, match="at least two methods"):
        mixed_logistic([row for row in simulated_trials(0.0) if row["robot"] == "a"], "robot", ("participant",))


def test_power_grows_with_people_and_is_that_of_the_f_distribution():
    needed = people_needed(5, 0.14, epsilon=0.75)
    assert needed["power"] >= 0.8
    assert people_needed(5, 0.14, epsilon=0.75, people=needed["people"] - 1)["power"] < 0.8
    # Of pingouin 0.7.0: power_rm_anova.
    power = people_needed(5, 0.14, epsilon=0.75, correlation=0.3, people=12)["power"]
    assert power == pytest.approx(0.7266950713419025)
    with pytest.raises(InvalidValueError, match=r"epsilon: expected 0.25 to 1, found 0.1"):
        people_needed(5, 0.14, epsilon=0.1)


def test_simulated_studies_reject_as_often_as_the_power_says():
    rng = np.random.default_rng(3)
    n, k, correlation = 12, 3, 0.5
    means = np.array([0.0, 0.35, 0.7])
    eta = means.var() / (means.var() + 1.0)  # between conditions, of the variance of single values
    expected = people_needed(k, float(eta), correlation=correlation, people=n)["power"]
    covariance = np.full((k, k), correlation) + np.eye(k) * (1 - correlation)
    rejected = 0
    for _ in range(400):
        values = rng.multivariate_normal(means, covariance, size=n)
        residual = values - values.mean(axis=0) - values.mean(axis=1, keepdims=True) + values.mean()
        f = n * ((values.mean(axis=0) - values.mean()) ** 2).sum() / (k - 1)
        f /= (residual**2).sum() / ((n - 1) * (k - 1))
        rejected += stats.f.sf(f, k - 1, (n - 1) * (k - 1)) < 0.05
    assert rejected / 400 == pytest.approx(expected, abs=0.08)


def test_the_commands_print_and_write_the_analysis(tmp_path, capsys):
    out = tmp_path / "analysis.md"
    flags = ["compare", "--measurements", str(TRIALS), "--factors", "method", "configuration"]
    assert main([*flags, "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "| method x configuration | F(4, 20) = 3.170 | .0360 |" in printed
    assert "unit of analysis: the participant, n = 6" in printed
    assert out.read_text(encoding="utf-8") == printed
    assert main([*flags, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["markdown"] == markdown(document) == printed
    assert main(["power", "--robots", "5", "--effect", "0.14", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["people"] > 5


@pytest.mark.parametrize(
    ("flags", "problem"),
    [
        (["a.json", "--measurements", str(TRIALS), "--factors", "method"], "--measurements: expected no results"),
        (["--measurements", str(TRIALS)], "--factors: expected one or two different columns"),
        (["--measurements", str(TRIALS), "--factors", "speed"], "found no column speed"),
        (["--measurements", "none.csv", "--factors", "method"], "none.csv"),
        (["a.json", "b.json", "--unit", "map"], "--unit: expected --measurements too, found 'map'"),
    ],
)
def test_wrong_calls_are_one_line(capsys, flags, problem):
    assert main(["compare", *flags]) == 2
    error = capsys.readouterr().err
    assert problem in error
    assert error.count("\n") == 1


def test_estimates_and_errors_of_the_mixed_model_are_calibrated():
    estimates, errors, spreads = [], [], []
    for seed in range(20):
        fit = mixed_logistic(simulated_trials(2.0, seed), "robot", ("participant", "map_id"))
        assert fit is not None
        estimates.append(fit["methods"]["b"]["log_odds"])
        errors.append(fit["methods"]["b"]["standard_error"])
        spreads.append(fit["random_intercepts"]["participant"]["sd_log_odds"])
    spread = np.std(estimates, ddof=1)
    assert np.mean(estimates) == pytest.approx(2.0, abs=3 * spread / np.sqrt(20))
    assert np.mean(errors) == pytest.approx(spread, rel=0.4)
    assert np.mean(spreads) == pytest.approx(1.5, abs=0.35)


def test_a_method_that_always_succeeds_has_a_finite_effect():
    rows = [{**row, "success": row["success"] or row["robot"] == "b"} for row in simulated_trials(0.0)]
    fit = mixed_logistic(rows, "robot", ("participant", "map_id"))
    assert fit is not None
    assert 2 < fit["methods"]["b"]["log_odds"] < 12
    assert np.isfinite(fit["methods"]["b"]["interval_95"]).all()
