"""Studies of a second task: of its settings and agents; what it does not measure is null with its reason."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from peg_data import convert_pegs, record_pegs
from training_table import flags

from copolicy.dataset.task import get_task, load_task
from copolicy.evaluate.cli import main
from copolicy.evaluate.human_study.plan import StudyPlan
from copolicy.train.cli import main as train

REASON = "left out: the task 'peg' has no interaction measure"


@pytest.fixture(scope="module")
def runs(tmp_path_factory) -> Iterator[list[Path]]:
    """Two policies of the peg, 50 steps each, while it is installed."""
    folder = tmp_path_factory.mktemp("peg")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parent / "peg_task"))
        root = convert_pegs(record_pegs(folder / "recordings"), folder / "set")
        for seed in range(2):
            assert train(flags(root, folder / f"run{seed}", steps=50, save_freq=50, seed=seed)) == 0
        yield [folder / f"run{seed}" for seed in range(2)]
    load_task.cache_clear()


def judged(out: Path, *call: object) -> Any:
    """The result of a study."""
    assert main([*map(str, call), "--maps", "right", "--out", str(out)]) == 0
    return json.loads(out.read_text(encoding="utf-8"))


def test_co_planning_and_a_comparison_leave_out_what_the_task_does_not_measure(runs, tmp_path, capsys):
    one, other = (judged(tmp_path / f"{k}.json", "coplan", "--policy", run) for k, run in enumerate(runs))
    assert one["settings"]["task"] == one["policy"]["learned"]["task"] == "peg"
    assert (one["settings"]["hold"], one["settings"]["step_limit"]) == (2, 200)
    assert "angular_acceleration_limit" not in one["settings"]
    assert one["summary"]["interaction_force"] is None
    assert one["not_measured"] == {"interaction_force": REASON}
    assert "by_obstacles" not in one["summary"]
    row = one["episodes"][0]
    assert (row["map_id"], row["interaction_mean"], "start_theta" in row) == ("right-00", None, False)
    assert row["time_s"] == row["steps"] / 20
    told = capsys.readouterr().out
    assert "\ninteraction_force " not in told
    assert f"interaction_force  {REASON}" in told
    assert (tmp_path / "0.png").is_file()
    assert other["summary"]["success"]["episodes"] == 3

    files = [str(tmp_path / f"{k}.json") for k in range(2)]
    assert main(["compare", *files]) == 0
    told = capsys.readouterr().out
    assert "| method | runs | success, % (max) | time, s |\n" in told
    assert f"- interaction_mean: {REASON}." in told
    assert main(["compare", *files, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["methods"]["0"]["interaction_mean"]["mean"] is None
    assert "interaction_mean" not in found["definitions"]


def test_the_partners_are_the_tasks(runs, tmp_path, capsys):
    result = judged(tmp_path / "partner.json", "partner", f"A={runs[0]}")
    assert list(result["settings"]["partners"]) == ["helper", "hesitant"]
    assert [one["name"] for one in result["baselines"]] == ["passive", "scripted"]
    assert (result["settings"]["configurations"], result["settings"]["orientations"]) == (3, False)
    assert result["settings"]["complete_set"] is True
    assert result["summary"]["deadlock"] is None
    assert set(result["not_measured"]) == {"interaction_force", "deadlock"}
    assert result["definitions"].keys().isdisjoint(result["not_measured"])
    assert result["definitions"]["success"].startswith("proportion of episodes that end with mark;")
    assert "map" not in result["label"]
    # Forces and ways are those of the outline.
    scripted = result["baselines"][1]["summary"]
    assert 0 < scripted["robot_share"] <= 1
    assert result["baselines"][0]["summary"]["robot_share"] == 0
    assert {row["deadlock_s"] for row in result["episodes"]} == {None}
    told = capsys.readouterr().out
    assert "robot_share" in told
    assert "deadlock_time_share" not in told


def test_cross_play_leaves_out_what_the_task_lacks(runs, tmp_path, capsys):
    out = tmp_path / "crossplay"
    partners = ["P=proxy:{1},delay=0.1,noise=0.2".format(*runs), "helper,noise=0.2", f"replay:{runs[0].parent / 'set'}"]
    call = ["--robots", f"A={runs[0]}", "--partners", *partners, "--maps", "right", "--configurations", "2"]
    assert main(["cross-play", *call, "--allow-overlap", "--step-limit", "100", "--out", str(out)]) == 0
    capsys.readouterr()
    result = json.loads((out / "matrix.json").read_text(encoding="utf-8"))
    assert list(result["cells"]) == ["own-kind", "A", "nothing", "random"]  # its scripted robot is no floor
    # The peg has no exchange of seats: a scripted partner cannot sit at the robot's.
    assert result["no_own_kind"]["helper,noise=0.2"] == "left out: the task 'peg' has no exchange of seats"
    assert set(result["cells"]["own-kind"]) == {"P", "replay:set"}
    missing = ["interaction_force", "relative_force", "deadlock", "smallest_distance", "near_misses", "gave_way"]
    assert list(result["not_measured"]) == missing
    assert result["not_measured"]["interaction_force"] == REASON
    measures = result["cells"]["A"]["helper,noise=0.2"]["measures"]
    assert all(measures[name] is None for name in missing)
    assert measures["robot_share"]["n"] == 2
    assert result["overlap"]["shared"] == {"A": {"P": ["even", "lazy"]}}
    assert result["cells"]["own-kind"]["replay:set"]["measures"]["success"]["mean"] == 1.0
    assert result["scores"]["robots"]["A"]["by_partner"].keys() >= {"replay:set"}
    assert "helper,noise=0.2" not in result["scores"]["robots"]["A"]["by_partner"]
    text = (out / "matrix.md").read_text(encoding="utf-8")
    assert f"- interaction_force: {REASON}." in text
    assert "**interaction force**" not in text


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (["coplan", "--policy", "{0}", "--orientations"], "--orientations: expected no such flag, found"),
        (["coplan", "--policy", "{0}", "--angular-limit", "pi/8"], "--angular-limit: expected no such flag, found"),
        (["coplan", "--policy", "{0}", "--fps", "8"], "fps: expected a divisor of 20 [1, 2, 4, 5, 10, 20], found 8"),
        (["partner", "A={0}", "--partners", "slow"], "unknown kind of partner 'slow'; available: helper, hesitant"),
        (["partner", "A={0}", "--partners", "human-like"],
         "expected a partner that the task has, found \"left out: the task 'peg' has no human-like player\""),
        (["partner", "A={0}", "--configurations", "4"], "--configurations: expected 1 to 3, found 4"),
        (["partner", "A={0}", "--baseline", "B=pretrained"],
         "policies: expected ones that learned the same task, found {{'A': 'peg', 'B': 'table'}}"),
        (["human", "plan", "A={0}", "B={1}", "--angular-limit", "pi/2"], "--angular-limit: expected no such flag"),
    ],
)  # fmt: skip
def test_what_the_task_lacks_is_refused(runs, tmp_path, capsys, call, message):
    arguments = [text.format(*runs) for text in call]
    assert main([*arguments, "--maps", "right", "--out", str(tmp_path / "x.json")]) == 2
    assert message.format() in capsys.readouterr().err.splitlines()[-1]
    assert not list(tmp_path.iterdir())


def test_a_human_study_is_planned_run_and_summarised(runs, tmp_path, capsys):
    path, out = tmp_path / "plan.json", tmp_path / "recordings"
    calls = [f"A={runs[0]}", f"B={runs[1]}", "--participants", "1", "--maps", "right", "--out", str(path)]
    assert main(["human", "plan", *calls, "--episodes-per-robot", "1", "--step-limit", "60"]) == 0
    content = json.loads(path.read_text(encoding="utf-8"))
    assert (content["task"], content["step_limit"], "angular_acceleration_limit" in content) == ("peg", 60, False)
    plan = StudyPlan.read(path)
    assert plan.world_settings == get_task("peg").settings_type(step_limit=60)
    assert plan.configurations == tuple(get_task("peg").scenario_sets["right"])
    session = ["--participant", "P01", "--human", "scripted:lazy", "--headless", "--practice", "0", "--countdown", "0"]
    assert main(["human", "run", str(path), "--out", str(out), *session]) == 0
    capsys.readouterr()
    assert main(["human", "summarise", str(out), "--plan", str(path), "--out", str(tmp_path / "result.json")]) == 0
    told = capsys.readouterr().out
    assert f"interaction_force  {REASON}" in told
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert (result["settings"]["task"], result["settings"]["step_limit"]) == ("peg", 60)
    assert list(result["tests"]) == ["success", "time_s"]
    assert {row["interaction_mean"] for row in result["rows"]} == {None}
    assert all(row["time_s"] == row["steps"] / 20 for row in result["rows"])


def test_behaviours_that_the_task_does_not_define_are_left_out_with_their_reason(runs, tmp_path):
    assert main(["behaviours", str(runs[0].parent / "set"), "--out", str(tmp_path), "--no-videos"]) == 0
    result = json.loads((tmp_path / "behaviours.json").read_text(encoding="utf-8"))
    assert set(result["not_counted"]) == {"disagreement", "adaptation", "dissent"}
    assert result["not_counted"]["dissent"].startswith(
        "left out: the task 'peg' has no thresholds of its interaction measure"
    )
    assert list(result["definitions"]) == ["leadership_switch", "passivity_robot", "passivity_human", "pivot"]
    (method,) = result["methods"].values()
    assert method["label"] == "demonstrations, source: simulated"
    assert method["leadership_switch"]["per_minute"]["null"]["p"] > 0
