"""`copolicy-collect maps`, and a file of maps through every room."""

import json
from collections import Counter

import pytest
from map_file import write_lab

from copolicy.collect.cli import main
from copolicy.collect.play.settings import PlaySettings
from copolicy.collect.session.schedule import BalancedSchedule, EpisodeCounts
from copolicy.dataset.recording.reader import read_episode
from copolicy.dataset.task import get_task
from copolicy.tasks.table.world import TableWorld


def output(capsys, *arguments):
    status = main([str(argument) for argument in arguments])
    said = capsys.readouterr()
    return status, said.out, said.err


def test_check_says_a_line_a_problem(tmp_path, capsys):
    status, out, _ = output(capsys, "maps", "check", write_lab(tmp_path))
    assert status == 0
    assert "train  3" in out
    path = write_lab(tmp_path, "goal: {x: 960, y: 420}", "goal: {x: 1300, z: 3}")
    status, out, _ = output(capsys, "maps", "check", path)
    assert (status, out.splitlines()[:2]) == (
        1,
        ["maps[2].goal.z (line 18): unknown key; known are x, y", "maps[2].goal (line 18): no y"],
    )
    status, out, _ = output(capsys, "maps", "check", path, "--json")
    assert (status, json.loads(out)["passed"], len(json.loads(out)["problems"])) == (1, False, 2)
    status, _, err = output(capsys, "maps", "check", tmp_path / "none.yaml")
    assert status == 2
    assert err.endswith("none.yaml: expected a scenario file, YAML or JSON, found no such file\n")


def test_show_draws_every_map_with_its_own_obstacles(tmp_path, capsys):
    from copolicy.collect.sdl import pygame

    path, sheet = write_lab(tmp_path), tmp_path / "lab.png"
    status, out, _ = output(capsys, "maps", "show", path, "--out", sheet, "--width", "1200", "--json")
    assert (status, json.loads(out)["maps"]) == (0, 4)
    image = pygame.image.load(str(sheet))
    assert list(image.get_size()) == json.loads(out)["size"]
    # The first map: its upper obstacle reaches further than its lower one.
    cell = (1200 - 3 * 12) / 2
    floor = image.get_at((12 + round(cell * 0.3), 64 + round(cell * 0.25)))
    middle = 12 + round(cell / 2)
    sides = []
    for y in (100, 500):
        row = 64 + round(y * cell / 1200)
        sides.append(sum(image.get_at((middle + dx, row)) != floor for dx in range(-60, 61)) * 1200 / cell)
    assert sides[0] / sides[1] == pytest.approx(2, abs=0.35)  # with their shadows, a twelfth of the side
    assert output(capsys, "maps", "show", path, "--out", sheet)[0] == 2
    assert output(capsys, "maps", "show", "nowhere", "--out", tmp_path / "a.png")[2].startswith(
        "copolicy-collect: unknown map set 'nowhere'; available: holdout,"
    )


def test_make_writes_a_file_that_passes(tmp_path, capsys):
    path = tmp_path / "drawn.yaml"
    arguments = ("maps", "make", "--count", 3, "--seed", 5, "--bounds", "obstacles=2", "obstacle_size=40:80", "--out")
    assert output(capsys, *arguments, path)[0] == 0
    assert output(capsys, *arguments, tmp_path / "again.yaml", "--name", "drawn")[0] == 0
    assert path.read_bytes() == (tmp_path / "again.yaml").read_bytes()
    assert output(capsys, "maps", "check", path)[0] == 0
    for bound, line in (
        ("obstacle=2", "unknown bound 'obstacle'; available: goal_x, goal_y, obstacle_size,"),
        ("obstacles=3:2", "--bounds: expected LOW not above HIGH, both within 1e6 of 0, found 'obstacles=3:2'"),
        ("obstacles=two", "--bounds: expected NAME=LOW:HIGH or NAME=VALUE, in numbers, found 'obstacles=two'"),
    ):
        status, _, err = output(
            capsys, "maps", "make", "--count", "1", "--bounds", bound, "--out", tmp_path / "no.yaml"
        )
        assert (status, err.startswith(f"copolicy-collect: {line}")) == (2, True)
    assert not (tmp_path / "no.yaml").exists()
    assert output(capsys, *arguments, path)[0] == 2  # it is there already


def test_schema_is_printed(capsys):
    files = get_task().scenario_files
    assert files is not None
    assert json.loads(output(capsys, "maps", "schema")[1]) == files.schema


def test_weights_steer_the_schedule_of_play(tmp_path):
    settings = PlaySettings("P01", tmp_path, maps=str(write_lab(tmp_path)))
    assert settings.session_settings()["maps"] == "lab-doors"
    assert settings.session_settings()["maps_digest"] == settings.scenario_set.digest
    balance, counts = BalancedSchedule(settings.scenarios, 20, 0, "P01", swap=False), EpisodeCounts()
    for _ in range(20):
        config, seating = balance.next(counts)
        for counter in (counts.kept, counts.attempted, counts.kept_in_session):
            counter[get_task().identify(config)[0], seating] += 1
    assert counts.kept == {
        ("lab-doors-wide", 0): 8, ("lab-doors-turned-0deg", 0): 4, ("lab-doors-turned-90deg", 0): 4,
        ("lab-doors-02", 0): 4,
    }  # fmt: skip


def test_a_table_stops_at_obstacles_of_their_own_size(tmp_path):
    world = TableWorld(get_task().scenario_set(str(write_lab(tmp_path))).scenarios[0])
    # The board's box reaches 48 px up and down: 60 px from the centre of the small square it is free of it.
    upper, lower = (
        next(gap for gap in range(200) if not world.contact((600.0, 300 + side * (200 - gap), 0.0)).obstacle)
        for side in (-1, 1)
    )
    assert upper - lower == pytest.approx(30, abs=1)


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    """Recordings and a data set of five episodes on the maps of a file."""
    pytest.importorskip("lerobot")
    from copolicy.convert.cli import main as convert

    folder = tmp_path_factory.mktemp("lab")
    path = write_lab(folder)
    command = ["simulate", "--maps", str(path), "--episodes", "5", "--out", str(folder / "rec"), "--workers", "1"]
    assert main(command) == 0
    assert convert(["mcap", str(folder / "rec"), "--out", str(folder / "set"), "--repo-id", "lab/doors"]) == 0
    return folder


def test_recordings_say_which_file_their_map_is_of(walked):
    episodes = [read_episode(path) for path in sorted((walked / "rec").glob("*.mcap"))]
    digest = get_task().scenario_set(str(walked / "lab.yaml")).digest
    assert Counter(episode.meta.map_id for episode in episodes) == {
        "lab-doors-wide": 2, "lab-doors-turned-0deg": 1, "lab-doors-turned-90deg": 1, "lab-doors-02": 1,
    }  # fmt: skip
    for episode in episodes:
        meta = episode.meta
        wide = meta.map_id == "lab-doors-wide"
        assert (meta.map_set, meta.map_set_version, meta.map_set_digest) == ("lab-doors", "1", digest)
        assert meta.map_weight == 1 + wide
        assert meta.obstacle_sizes == ("120,60" if wide else "")
        assert (episode.map_config.sizes == (120, 60)) == wide
    assert main(["replay", str(next((walked / "rec").glob("*.mcap"))), "--verify"]) == 0


def test_a_data_set_of_a_file_is_checked_and_described(walked, capsys):
    from copolicy.cards.episode_frames import read_frames
    from copolicy.cards.facts import DatasetFacts
    from copolicy.dataset.checks.checking import check_dataset

    findings = check_dataset(walked / "set").findings
    assert {finding.rule for finding in findings if finding.severity == "error"} <= {"license"}
    assert not [finding for finding in findings if finding.rule.startswith(("map_", "obstacle_size"))]
    facts = DatasetFacts.read(walked / "set")
    sizes = {row["map_id"]: frames.scenario.sizes for row, frames in zip(facts.episodes, read_frames(facts))}  # noqa: B905
    assert sizes["lab-doors-wide"] == (120, 60)


def test_co_planning_on_a_split_of_a_file(walked, capsys):
    from copolicy.evaluate.cli import main as evaluate

    out = walked / "eval.json"
    maps = f"{walked / 'lab.yaml'}#train"
    flags = ["--step-limit", "30", "--num-inference-steps", "1", "--backend", "torch", "--limit", "2"]
    assert evaluate(["coplan", "--policy", "pretrained", "--maps", maps, "--out", str(out), *flags]) == 0
    result = json.loads(out.read_text(encoding="utf-8"))
    chosen = get_task().scenario_set(maps)
    assert result["settings"]["maps"] == "lab-doors#train"
    assert result["settings"]["map_set"] == {
        "name": "lab-doors#train", "version": "1", "digest": chosen.digest, "from": "file",
    }  # fmt: skip
    assert [row["map_id"] for row in result["episodes"]] == ["lab-doors-wide", "lab-doors-turned-0deg"]
    # Another file of that name is no protocol to compare with.
    other = walked / "other.json"
    result["settings"]["map_set"]["digest"] = "0" * 16
    result["policy"]["weights_sha256"] = "another"
    other.write_text(json.dumps(result), encoding="utf-8")
    capsys.readouterr()
    assert evaluate(["compare", str(out), str(other), "--out", str(walked / "compared.json")]) == 2
    err = capsys.readouterr().err
    assert f"found lab-doors#train of other content, version 1, digest {'0' * 16}" in err
    assert err.count("\n") == 1


def test_the_plan_of_a_human_study_keeps_the_names_of_a_file(tmp_path):
    pytest.importorskip("lerobot")
    from copolicy.evaluate.human_study.design import make_plan
    from copolicy.evaluate.human_study.plan import Robot, StudyPlan
    from copolicy.evaluate.partner_study.configurations import study_configurations

    chosen = get_task().scenario_set(str(write_lab(tmp_path)))
    starts = study_configurations(chosen, 8)
    robots = [Robot("A", "a", "0" * 64), Robot("B", "b", "1" * 64)]
    plan = make_plan(robots, chosen.label, starts, 2, 4, 0)
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(plan.to_json()), encoding="utf-8")
    read = StudyPlan.read(path)
    assert [config.named for config in read.configurations] == [config.named for config in starts]
    assert [config.sizes for config in read.configurations] == [config.sizes for config in starts]
    assert read.map_set["map_set"]["digest"] == chosen.digest


def test_the_environment_starts_on_the_maps_of_a_split(tmp_path):
    pytest.importorskip("lerobot")
    from copolicy.dataset.exceptions import CopolicyError
    from lerobot_policy_copolicy.env.configuration_table_carrying import TableCarryingEnvConfig
    from lerobot_policy_copolicy.env.table_carrying import TableCarryingEnv

    path = write_lab(tmp_path)
    assert TableCarryingEnvConfig(map_set=f"{path}#train").map_set == f"{path}#train"
    assert len(TableCarryingEnv(map_set=f"{path}#train").scenarios) == 3
    assert len(TableCarryingEnv(map_set=f"{path}#train", orientations=True).scenarios) == 8
    with pytest.raises(CopolicyError, match="unknown split"):
        TableCarryingEnvConfig(map_set=f"{path}#valid")
