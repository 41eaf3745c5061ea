"""`copolicy-collect maps check | show | make | schema`."""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import Commands, add_command, add_group
from copolicy.dataset.command_line.flag_numbers import seed, whole_number
from copolicy.dataset.command_line.maps_flag import add_task_flag
from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.files.staging import new_file, require_new
from copolicy.dataset.scenarios import SUFFIXES, ScenarioFiles
from copolicy.dataset.task import PairTask, get_task

_MOST_MAPS = 10_000


def add_maps_command(commands: Commands) -> None:
    """Adds `maps` with its steps to the commands of `copolicy-collect`."""
    steps = add_group(
        commands,
        "maps",
        "check, show and make files of your own maps; every --maps accepts such a file",
        "Files of your own maps, in YAML or JSON, for every --maps.",
        (
            "copolicy-collect maps make --count 20 --seed 1 --out lab.yaml",
            "copolicy-collect maps check lab.yaml",
            "copolicy-collect maps show lab.yaml --out lab.png",
            "copolicy-collect simulate --maps lab.yaml --episodes 100 --out recordings/lab",
        ),
    )
    command = add_command(
        steps, "check", _check, "print each problem of a file in one line", "copolicy-collect maps check lab.yaml"
    )
    command.add_argument("file", type=Path, metavar="FILE", help="maps in YAML or JSON")
    add_task_flag(command)
    command = add_command(
        steps,
        "show",
        _show,
        "draw all maps of a set or file in one image",
        "copolicy-collect maps show unseen --out unseen.png\n  copolicy-collect maps show lab.yaml#test --out test.png",
    )
    command.add_argument("maps", metavar="NAME|FILE[#SPLIT]", help="a set, a file of maps, or one of its splits")
    command.add_argument("--out", type=Path, required=True, help="the image to write, a PNG")
    command.add_argument("--orientations", action="store_true", help="each map with four start orientations")
    command.add_argument("--width", type=whole_number("--width", 300, 10_000), default=1800, help="px (default 1800)")
    add_task_flag(command)
    command = add_command(
        steps,
        "make",
        _make,
        "write random maps to a file that passes `check`",
        "copolicy-collect maps make --count 50 --seed 1 --bounds obstacles=2:3 obstacle_size=40:80 --out lab.yaml",
    )
    command.add_argument("--count", type=whole_number("--count", 1, _MOST_MAPS), required=True, help="how many maps")
    command.add_argument("--seed", type=seed(), default=0, help="equal seeds and bounds give equal maps (default 0)")
    command.add_argument(
        "--bounds", nargs="+", default=[], metavar="NAME=LOW:HIGH",
        help="bounds of the random values, or NAME=VALUE for one value; the summary lists all bounds with their "
        "defaults",
    )  # fmt: skip
    command.add_argument("--name", help="name of the set (default: the name of the file)")
    command.add_argument("--out", type=Path, required=True, help="the file to write, .yaml or .json")
    add_task_flag(command)
    command = add_command(
        steps, "schema", _schema, "print the JSON schema of a file", "copolicy-collect maps schema > maps.schema.json"
    )
    add_task_flag(command)


def _files(task: PairTask) -> ScenarioFiles:
    if task.scenario_files is None:
        raise InvalidValueError("--task", "a task with scenario files", task.missing("scenario files"))
    return task.scenario_files


def _check(arguments: argparse.Namespace) -> dict[str, Any]:
    files = _files(get_task(arguments.task))
    problems = [str(problem) for problem in files.problems(arguments.file)]
    result: dict[str, Any] = {"file": str(arguments.file), "problems": problems if arguments.json else len(problems)}
    if problems:
        if not arguments.json:
            print("\n".join(problems))
            sys.stdout.flush()
        return {**result, "passed": False, "exit_status": 1}
    map_set = files.read(arguments.file)
    splits = {name: len(indices) for name, indices in map_set.splits.items()}
    return {
        **result, **map_set.describe(), "maps": len(map_set.scenarios), **({"splits": splits} if splits else {}),
        "passed": True,
    }  # fmt: skip


def _show(arguments: argparse.Namespace) -> dict[str, Any]:
    if arguments.out.suffix.lower() != ".png":
        raise InvalidValueError("--out", "a name that ends with .png", str(arguments.out))
    require_new(arguments.out)
    task = get_task(arguments.task)
    map_set = task.scenario_set(arguments.maps)
    if arguments.orientations:
        map_set = task.turned(map_set)
    from .sheet import write_map_sheet  # pygame

    size = write_map_sheet(task, map_set, arguments.out, arguments.width)
    return {**map_set.describe(), "maps": len(map_set.scenarios), "out": str(arguments.out), "size": list(size)}


def _make(arguments: argparse.Namespace) -> dict[str, Any]:
    path: Path = arguments.out
    if path.suffix.lower() not in SUFFIXES:
        raise InvalidValueError("--out", f"a name that ends with {', '.join(SUFFIXES)}", str(path))
    require_new(path)
    files = _files(get_task(arguments.task))
    bounds = {**files.bounds, **_bounds(arguments.bounds, files.bounds)}
    content = files.make(arguments.name or path.stem, arguments.count, arguments.seed, bounds)
    path.parent.mkdir(parents=True, exist_ok=True)
    with new_file(path) as partial:
        partial.write_text(_text(content, path.suffix.lower() == ".json"), encoding="utf-8")
    return {"out": str(path), **files.read(path).describe(), "maps": arguments.count, "bounds": _bounds_text(bounds)}


def _text(content: Mapping[str, Any], as_json: bool) -> str:
    if as_json:
        return json.dumps(content, indent=1) + "\n"
    import yaml  # slow to import, and no other command needs it

    return yaml.safe_dump(dict(content), sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)


def _bounds(texts: Sequence[str], defaults: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    bounds = {}
    for text in texts:
        name, equals, values = text.partition("=")
        if equals and name not in defaults:
            raise UnknownNameError("bound", name, defaults)
        low, colon, high = values.partition(":")
        try:
            pair = float(low), float(high if colon else low)
        except ValueError:
            raise InvalidValueError("--bounds", "NAME=LOW:HIGH or NAME=VALUE, in numbers", text) from None
        if not (-1e6 < pair[0] <= pair[1] < 1e6):
            raise InvalidValueError("--bounds", "LOW not above HIGH, both within 1e6 of 0", text)
        bounds[name] = pair
    return bounds


def _bounds_text(bounds: Mapping[str, tuple[float, float]]) -> list[str]:
    return [f"{name}={low:g}:{high:g}" if low < high else f"{name}={low:g}" for name, (low, high) in bounds.items()]


def _schema(arguments: argparse.Namespace) -> dict[str, Any]:
    print(json.dumps(_files(get_task(arguments.task)).schema, indent=1))
    return {}
