"""Files of maps: what they hold, and what is wrong with them in one line each."""

import json
import math
from pathlib import Path

import pytest
from map_file import LAB, write_lab

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, RunError, UnknownNameError
from copolicy.dataset.scenarios import ScenarioName
from copolicy.dataset.task import get_task
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.map_files import MapFiles
from copolicy.tasks.table.map_problems import map_problems
from copolicy.tasks.table.maps import MAP_SETS

FILES = MapFiles()
MAP = "  - start: {{x: {x}, y: 300, theta: {theta}}}\n    goal: {{x: {goal}, y: 300}}\n    obstacles: [{obstacles}]\n"


def said(path):
    return [str(problem) for problem in FILES.problems(path)]


def test_the_maps_of_a_file(tmp_path):
    chosen = get_task().scenario_set(str(write_lab(tmp_path)))
    wide, first, second, free = chosen.scenarios
    assert (chosen.name, chosen.version, chosen.from_file) == ("lab-doors", "1", True)
    assert wide == MapConfig((240, 300, math.pi), (960, 300), ((600, 100), (600, 500)), 120, (120, 60))
    assert wide.squares == (((600.0, 100.0), 120), ((600.0, 500.0), 60))
    assert (first.start[2], second.start[2]) == (0.0, math.pi / 2)
    assert free == MapConfig((240, 300, 3.14), (960, 420))
    assert wide.named == ScenarioName("lab-doors-wide", "lab-doors", "1", chosen.digest, 2)
    names = [get_task().identify(config)[0] for config in chosen.scenarios]
    assert names == ["lab-doors-wide", "lab-doors-turned-0deg", "lab-doors-turned-90deg", "lab-doors-02"]
    assert chosen.weights == (2, 1, 1, 1)
    assert len(chosen.scheduled) == 5


def test_splits_and_orientations(tmp_path):
    path = write_lab(tmp_path)
    whole, train, test = (get_task().scenario_set(f"{path}{split}") for split in ("", "#train", "#test"))
    assert train.scenarios == whole.scenarios[:3]
    assert test.scenarios == whole.scenarios[3:]
    assert (train.label, train.digest) == ("lab-doors#train", whole.digest)
    turned = get_task().turned(whole)
    assert len(turned.scenarios) == 12  # three maps, whatever orientations each has of its own
    assert [get_task().identify(config)[0] for config in turned.scenarios[4:6]] == [
        "lab-doors-turned-0deg", "lab-doors-turned-90deg",
    ]  # fmt: skip
    assert turned.weights == (2,) * 4 + (1,) * 8
    with pytest.raises(UnknownNameError, match="unknown split of lab-doors 'valid'; available: test, train"):
        get_task().scenario_set(f"{path}#valid")


def test_a_path_may_hold_the_mark_of_a_split(tmp_path):
    path = write_lab(tmp_path, name="lab#2.yaml")
    assert len(get_task().scenario_set(str(path)).scenarios) == 4
    assert len(get_task().scenario_set(f"{path}#train").scenarios) == 3


def test_json_says_the_same(tmp_path):
    import yaml

    path = tmp_path / "lab.json"
    path.write_text(json.dumps(yaml.safe_load(LAB)), encoding="utf-8")
    assert FILES.read(path) == FILES.read(write_lab(tmp_path))


def test_the_digest_is_of_the_content(tmp_path):
    digest = FILES.read(write_lab(tmp_path)).digest
    assert FILES.read(write_lab(tmp_path, "author: The lab", "author: Another")).digest == digest
    for old, new in (("y: 420", "y: 421"), ("size: 60", "size: 61"), ("weight: 2", "weight: 3"), ("[2]", "[1]")):
        assert FILES.read(write_lab(tmp_path, old, new)).digest != digest


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("lab-doors", "training", "name (line 1): training is the name of a set of the package"),
        ("lab-doors", "Lab", "name (line 1): expected text matching regex '^[a-z][a-z0-9_-]{0,39}$', found 'Lab'"),
        ("cc-by-4.0", "CC BY 4", "license (line 4): expected cc-by-4.0, as the Hub spells it, found 'CC BY 4'"),
        ("    weight: 2", "    wieght: 2", "maps[0].wieght (line 12): unknown key; did you mean weight?"),
        ("weight: 2", "weight: 0", "maps[0].weight (line 12): expected a whole number >= 1, found 0"),
        ("180deg", "180", "maps[0].start (line 7): expected rad from -2 pi to 2 pi, found 180; degrees are written "
         "180deg"),
        ("theta: 180deg", "theta: -3.1416", None),
        ("180deg", "half", "maps[0].start (line 7): expected rad as a number, or degrees such as 90deg, found 'half'"),
        ("theta: 180deg", "z: 1", "maps[0].start.z (line 7): unknown key; known are x, y, theta, orientations"),
        ("  - start:", "  - name: wide\n    start:", "maps[2].name (line 17): wide is the name of maps[0] too"),
        ("0deg, 90deg", "90deg, 450deg", "maps[1].start.orientations (line 14): expected orientations that differ by "
         "at least a degree"),
        ("[wide, turned]", "[wide, narrow]", "splits.train (line 20): there is no map 'narrow'"),
        ("[2]", "[2, 2]", "splits.test (line 21): expected at least one map, and each once"),
        ("y: 100, size: 120", "y: 40, size: 120", "maps[0].obstacles[0] (line 10): the square of 120 px "
         "at (600, 40) lies outside the window of 1200 x 600 px"),
    ],
)  # fmt: skip
def test_one_thing_wrong_is_one_line(tmp_path, old, new, line):
    path = write_lab(tmp_path, old, new)
    assert said(path) == ([] if line is None else [line])
    if line is not None:
        with pytest.raises(FileFormatError) as error:
            get_task().scenario_set(str(path))
        assert str(error.value) == f"{path}: expected maps that can be used, found {line}"


def _maps(tmp_path, *maps):
    path = tmp_path / "maps.yaml"
    usual = {"x": 240, "theta": "180deg", "goal": 960, "obstacles": ""}
    text = "".join(MAP.format(**(usual | changed)) for changed in maps)
    path.write_text(f"name: lab\nversion: '2'\nmaps:\n{text}", encoding="utf-8")
    return path


def _square(x, y, size):
    return f"{{x: {x}, y: {y}, size: {size}}}"


def test_maps_that_nobody_can_carry(tmp_path):
    wall = ", ".join(_square(600, y, 196) for y in (100, 300, 500))
    # 130 px between obstacles: enough for the table's width, 40 px are not.
    door = ", ".join(_square(600, y, 230) for y in (118, 482))
    narrow = ", ".join(_square(600, y, 260) for y in (140, 460))
    path = _maps(
        tmp_path,
        {"x": 590, "obstacles": _square(600, 310, 50)},
        {"obstacles": wall},
        {"obstacles": door},
        {"obstacles": narrow},
        {"x": 20},
        {"goal": 1180},
        {"goal": 330},
        {"obstacles": f"{_square(600, 300, 40)}, {_square(600, 300, 60)}"},
    )
    assert [problem.split(": ", 1)[0].split(" ")[0] for problem in said(path)] == [
        "maps[0].start", "maps[1].goal", "maps[3].goal", "maps[4].start", "maps[5].goal", "maps[6].start",
        "maps[7].obstacles[1]",
    ]  # fmt: skip
    assert "maps[0].start (line 4): the table at (590, 300), 180 degrees, starts inside an obstacle" in said(path)
    assert any("out of reach: the table cannot pass the obstacles" in problem for problem in said(path))


def test_the_same_map_twice_whatever_the_order_of_its_obstacles(tmp_path):
    first, second = _square(600, 200, 50), _square(600, 450, 60)
    path = _maps(tmp_path, {"obstacles": f"{first}, {second}"}, {"obstacles": f"{second}, {first}"})
    assert said(path) == ["maps[1] (line 7): the same as maps[0]"]
    swapped = ", ".join((_square(600, 200, 60), _square(600, 450, 50)))
    assert said(_maps(tmp_path, {"obstacles": f"{first}, {second}"}, {"obstacles": swapped})) == []


def test_the_sets_of_the_package_have_no_problem():
    for name in ("training", "unseen"):
        assert list(map_problems([[config] for config in MAP_SETS[name]])) == []


def test_random_maps_pass_and_depend_on_seed_and_bounds_alone():
    bounds = {**FILES.bounds, "obstacles": (2, 3), "obstacle_size": (40, 90)}
    first = FILES.make("lab", 6, 1, bounds)
    assert first == FILES.make("lab", 6, 1, bounds)
    assert first["maps"] != FILES.make("lab", 6, 2, bounds)["maps"]
    for entry in first["maps"]:
        assert 2 <= len(entry["obstacles"]) <= 3
        assert all(40 <= obstacle["size"] <= 90 for obstacle in entry["obstacles"])
        assert entry["start"]["x"] == 240
    with pytest.raises(RunError, match="expected room for 3 maps, found 0"):
        FILES.make("lab", 3, 0, {**bounds, "start_x": (10, 20)})
    for name, bound in (("obstacles", (2, 4)), ("obstacles", (1.2, 1.8)), ("obstacle_size", (0, 50))):
        with pytest.raises(InvalidValueError, match=f"--bounds: expected {name} with a whole number in it"):
            FILES.make("lab", 1, 0, {**bounds, name: bound})
    with pytest.raises(InvalidValueError, match="no set of the package"):
        FILES.make("training", 1, 0, bounds)


def test_the_schema_in_the_docs_is_the_one_of_the_reader():
    path = Path(__file__).parent.parent / "collect" / "docs" / "maps.schema.json"
    assert json.loads(path.read_text(encoding="utf-8")) == FILES.schema


def test_the_example_of_the_docs_has_no_problem(tmp_path):
    text = (Path(__file__).parent.parent / "collect" / "docs" / "maps.md").read_text(encoding="utf-8")
    path = tmp_path / "example.yaml"
    path.write_text(text.split("```yaml\n")[1].split("```")[0], encoding="utf-8")
    assert said(path) == []
