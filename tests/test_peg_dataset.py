"""Every command of `copolicy-dataset` on data of a task with numbers alone."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from changed_tables import with_entry, with_frames
from checked_data import set_columns, set_frames
from hub_user import HubUser
from local_hub import LocalHub
from test_peg_task import record

from copolicy.convert.cli import main as convert
from copolicy.dataset.checks.checking import check_data, check_dataset, read_data
from copolicy.dataset.cli import main
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, STATE
from copolicy.dataset.files.meta_files import STATISTICS_FILE
from copolicy.dataset.task import Limit, Rule, TaskRules

OWN_RULES = ("jumps", "drift", "stuck", "goal_contact", "obstacle_contact", "wall_contact", "obstacle_sizes")


@pytest.fixture
def recordings(peg, tmp_path) -> Path:
    """Three episodes to the mark and two that stop on their way."""
    folder = tmp_path / "recordings"
    folder.mkdir()
    for index, steps in enumerate((None, None, None, 25, 30)):
        record(peg, folder / f"{index}.mcap", index % 3, steps)
    return folder


@pytest.fixture
def root(recordings, tmp_path, capsys) -> Path:
    """Their data set at 10 Hz."""
    assert (
        convert(["mcap", str(recordings), "--out", str(tmp_path / "set"), "--repo-id", "lab/peg", "--fps", "10"]) == 0
    )
    capsys.readouterr()
    return tmp_path / "set"


def json_of(capsys, *arguments: object, status: int = 0) -> dict:
    capsys.readouterr()
    assert main([*map(str, arguments), "--json"]) == status
    return json.loads(capsys.readouterr().out)


def test_sound_data_pass_and_rules_that_the_task_lacks_are_named(peg, recordings, root, capsys):
    for path in (recordings, root):
        document = json_of(capsys, "check", path, "--strict")
        assert (document["passed"], document["counts"]["error"], document["counts"]["warning"]) == (True, 0, 0)
        left_out = {name for name, reason in document["not_applied"].items() if reason.startswith("left out")}
        assert left_out == set(OWN_RULES)
        assert document["not_applied"]["stuck"] == "left out: the task 'peg' has no rule for a standstill"
        assert set(document["limits"]).isdisjoint({"jump", "drift.error", "contact_margin"})
        assert document["limits"]["achieved_hz.error"]["unit"] == "share of 20 Hz"
    assert main(["check", str(root)]) == 0
    assert "LeRobot v3 data set of two players at the task 'peg'.\n" in (root / "README.md").read_text(encoding="utf-8")
    assert "stuck             left out: the task 'peg' has no rule for a standstill" in capsys.readouterr().out
    assert main(["check", "--rules", "--task", "peg"]) == 0
    assert "px" not in capsys.readouterr().out


def test_what_the_task_does_not_know_is_found(root):
    sound = read_data(root)

    def put(place, value):
        return lambda values: values.__setitem__(place, value)

    for column, change, rule in (
        (STATE, put((3, 0), 1.5), "state_range"),
        (STATE, put((0, 0), 0.5), "map_start"),
        (STATE, put((4, 1), np.nan), "finite"),
        (ACTION, put((2, 1), 1.5), "action_range"),
        (ENVIRONMENT_STATE, put((3, 1), 0.3), "map_constant"),
        (ENVIRONMENT_STATE, put((slice(0, 10), 1), 0.3), "map_rows"),
        (ENVIRONMENT_STATE, put((slice(0, 10), 1), 1.3), "map_rows"),
    ):
        assert rule in errors(with_frames(sound, column, change)), (column, rule)
    for column, value, rule in (
        ("map_id", "right-09", "map_name"),
        ("map_id", "right-02", "map_rows"),
        ("map_set", "left", "map_name"),
        ("termination_reason", "goal", "schema"),
        ("success", False, "outcome"),
    ):
        assert rule in errors(with_entry(sound, column, 0, value)), (column, value)


def errors(table) -> set[str]:
    return {finding.rule for finding in check_data(table).findings if finding.severity == "error"}


def test_damage_fails_the_command(root, capsys):
    set_frames(root, STATE, lambda values: values * 3)
    set_columns(root, achieved_hz=[15.0] * 5)
    assert main(["check", str(root)]) == 1
    out = capsys.readouterr().out
    assert "error: state_range: episode 0: position is this far outside its bounds, in m" in out
    assert "error: achieved_hz: episode 0: relative deviation of the loop's rate from 20 Hz (0.25; limit 0.05)" in out


def test_a_task_brings_rules_of_its_own(peg, root, monkeypatch):
    def slow(table):
        speed = table.maximum(np.abs(table.frames[STATE][:, 1]))
        return table.over_limit("jump", speed, "faster than a peg")

    rules = Rule("jumps", "no faster than a peg", slow, (STATE,)), Rule("last", "nothing", lambda table: ())
    monkeypatch.setattr(type(peg), "rules", TaskRules(rules, {"jump": Limit(0.1, "m/s", "pegs are slow")}))
    result = check_dataset(root)
    assert result.applied[-1] == "last"
    assert {finding.message for finding in result.findings if finding.rule == "jump"} == {"faster than a peg"}
    assert "jumps" not in result.not_applied


def test_statistics_are_computed_as_far_as_the_task_goes(root, capsys):
    assert main(["stats", str(root)]) == 0
    assert "route_entropy  - (left out: the task 'peg' has no strategy labels)" in capsys.readouterr().out
    document = json.loads((root / STATISTICS_FILE).read_text(encoding="utf-8"))
    families = document["statistics"]
    left_out = {
        name: entry["note"].removeprefix("left out: the task 'peg' has no ")
        for family in families.values()
        for name, entry in family.items()
        if entry.get("note", "").startswith("left out")
    }
    assert left_out == {
        **dict.fromkeys(("route_class", "route_entropy", "route_between_pair_share"), "strategy labels"),
        **dict.fromkeys(("interaction_force_mean", "interaction_force_p95"), "interaction measure"),
        **dict.fromkeys(("path_modes", "visitation_entropy", "visitation_coverage"), "tracked point"),
        "visitation_divergence_between_pairs": "tracked point",
        "conflict_fraction": "velocity along the axes of an action",
        **dict.fromkeys(("sparc", "log_dimensionless_jerk"), "velocity"),
    }
    assert "human_reference" not in document
    assert families["forces"]["effort_asymmetry"]["value"] > 0
    assert families["smoothness"]["action_f95_player_0"]["value"] > 0
    assert "table" not in json.dumps(document)


def test_a_task_with_more_parts_has_more_statistics(peg, root, capsys, monkeypatch):
    """Labels, a measure, a point and a velocity in metres, where the table has its own in px."""
    kind = type(peg)
    monkeypatch.setattr(kind, "strategy", lambda self, scenario, states: "slow" if len(states) > 22 else "fast")
    monkeypatch.setattr(kind, "interaction", lambda self, states, actions: 50 * (actions[:, 0] - actions[:, 1]))
    monkeypatch.setattr(kind, "path", lambda self, states: self.outline.poses(states)[:, :2])
    monkeypatch.setattr(kind, "words", replace(peg.words, noun="peg", body="the peg's middle"))
    monkeypatch.setattr(kind, "statistics", peg.statistics.__class__(velocity=(1,), interaction_unit="N"))
    assert main(["stats", str(root)]) == 0
    families = json.loads((root / STATISTICS_FILE).read_text(encoding="utf-8"))["statistics"]
    assert families["routes"]["route_class"]["value"] == 3
    size, top = (families["forces"][f"interaction_force_{name}"] for name in ("mean", "p95"))
    assert (size["unit"], 0 < size["value"] < top["value"] <= 100) == ("N", True)
    assert top["interval"][0] <= top["value"] <= top["interval"][1]
    coverage = families["visitation"]["visitation_coverage"]["definition"]
    assert "the peg's middle visited, on a grid of 0.0416667 m" in coverage
    assert 0 < families["visitation"]["visitation_coverage"]["value"] < 1
    assert "the peg faster than 0.15 m/s" in families["forces"]["conflict_fraction"]["definition"]
    assert families["smoothness"]["sparc"]["value"] < 0


def test_edits_releases_and_differences(peg, recordings, root, tmp_path, capsys):
    part = json_of(capsys, "select", root, "--out", tmp_path / "part", "--map-ids", "right-00", "--results", "mark")
    assert part["episodes"] == 1
    json_of(
        capsys, "split", root, "--out", tmp_path / "parts", "--by", "maps", "--parts", "test=right-01", "train=rest"
    )
    document = json_of(capsys, "check", tmp_path / "parts/test", "--against", tmp_path / "parts/train")
    assert document["counts"]["error"] == 0
    assert json_of(capsys, "check", root, "--against", tmp_path / "parts/test", status=1)["counts"]["error"] > 0
    json_of(capsys, "amend", root, "--set", "consent_id=C-7", "--episode-ids", "0")
    json_of(capsys, "exclude", root, "--episode-ids", "4", "--reason", "late")
    json_of(capsys, "release", root, "--bump", "major", "--notes", "The first.")
    json_of(capsys, "withdraw", "C-7", root)
    assert len(read_data(root).labels) == 5
    json_of(capsys, "withdraw", "C-7", root, "--yes")
    table = read_data(root)
    assert (len(table.labels), table.task, table.damage) == (4, peg, ())
    assert json_of(capsys, "diff", tmp_path / "part", root, status=1)
    assert json_of(capsys, "diff", root, root) is not None


def test_published_and_pulled(root, peg, tmp_path):
    with LocalHub() as hub, HubUser(hub, tmp_path) as user:
        assert main(["release", str(root), "--bump", "major", "--notes", "The first."]) == 0
        (root / "README.md").write_text("---\nlicense: cc-by-4.0\n---\n# Pegs that two push\n", encoding="utf-8")
        done = user.run("publish", root, "--repo-id", "lab/peg", "--raw", tmp_path / "recordings", "--json")
        assert done.status == 0, done.err
        done = user.run("pull", "lab/peg", "--out", tmp_path / "pulled", "--with-raw", "--json")
        assert done.status == 0, done.err
        assert user.run("check", "lab/peg", "--revision", "data-1.0.0").status == 0
    assert read_data(tmp_path / "pulled").task == peg
    assert main(["check", str(tmp_path / "pulled" / "raw")]) == 0
