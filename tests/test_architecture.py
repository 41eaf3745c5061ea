"""The arrows between rooms, and the two traps of one namespace over five source roots."""

import ast
import functools
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ROOMS = ("dataset", "collect", "convert", "train", "cards")
ARROWS = {
    "dataset/copolicy/dataset": set(),
    "collect/copolicy/collect": {"dataset"},
    "collect/copolicy/tasks": {"dataset", "collect"},
    "convert/copolicy/convert": {"dataset", "collect"},
    "train/lerobot_policy_copolicy": {"dataset", "collect", "train"},
    "train/copolicy/train": {"dataset", "collect", "lerobot_policy_copolicy"},
    "train/copolicy/evaluate": {"dataset", "collect", "train", "lerobot_policy_copolicy"},
    "cards/copolicy/cards": {"dataset"},
}
"""Packages, and what each may import beside itself."""

ROOTS = tuple(folder.split("/", 1)[1].replace("/", ".") for folder in ARROWS)

TABLE = "copolicy.tasks.table"

HEAVY = {"torch", "torchvision", "lerobot", "datasets", "matplotlib", "pandas", "diffusers", "gymnasium"}


@functools.cache
def _import_statements(path: Path) -> tuple[ast.Import | ast.ImportFrom, ...]:
    """Those at the top of a file and inside its functions."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return tuple(node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom))


def _imports(path: Path) -> set[str]:
    """Absolute names that a file imports, at its top or inside a function."""
    names = set()
    for node in _import_statements(path):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif node.level == 0:
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def _rooms_imported(path: Path) -> set[str]:
    rooms = {name.split(".")[1] for name in _imports(path) if name.startswith("copolicy.")}
    return rooms | {root for name in _imports(path) if (root := name.split(".")[0]) == "lerobot_policy_copolicy"}


def _files(folder: str) -> list[Path]:
    files = sorted(path for path in (ROOT / folder).rglob("*.py") if "examples" not in path.parts)
    assert files, f"no source under {folder}/"
    return files


@pytest.mark.parametrize("package", ARROWS)
def test_a_package_imports_only_where_its_arrow_points(package):
    # Who may import a task is the next test's.
    allowed = ARROWS[package] | {package.rpartition("/")[2], "tasks"}
    found = {str(path.relative_to(ROOT)): _rooms_imported(path) - allowed for path in _files(package)}
    assert not {path: rooms for path, rooms in found.items() if rooms}


def _imports_the_table(path: Path) -> bool:
    return any(name == TABLE or name.startswith(f"{TABLE}.") for name in _imports(path))


def test_nothing_imports_the_table_but_itself_and_the_importer_of_the_original_program():
    by_name = {package: [path for path in _files(package) if _imports_the_table(path)] for package in ARROWS}
    found = {path.relative_to(ROOT).as_posix() for paths in by_name.values() for path in paths}
    allowed = ("collect/copolicy/tasks/table/", "convert/copolicy/convert/upstream/")
    assert [path for path in found if not path.startswith(allowed)] == []


@functools.cache
def _modules() -> dict[str, Path]:
    """Every module by its absolute name."""
    found = {}
    for room in ROOMS:
        for path in _files(room):
            parts = path.relative_to(ROOT / room).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@functools.cache
def _edges() -> dict[str, set[str]]:
    """The modules that each imports: at its top, inside a function or for types alone."""
    modules = _modules()
    edges: dict[str, set[str]] = {}
    for name, path in modules.items():
        package = name if path.name == "__init__.py" else name.rpartition(".")[0]
        edges[name] = set()
        for node in _import_statements(path):
            targets: list[str] = []
            if isinstance(node, ast.Import):
                targets = [alias.name for alias in node.names]
            else:
                above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
                base = ".".join([*above, *([node.module] if node.module else [])])
                targets = [f"{base}.{alias.name}" for alias in node.names]
            for target in targets:
                found = target if target in modules else target.rpartition(".")[0]
                if found in modules and found != name:
                    edges[name].add(found)
    return edges


def _cycles(edges: dict[str, set[str]]) -> list[set[str]]:
    """Names that reach each other, a set for each knot."""
    reached: dict[str, set[str]] = {}
    for start in edges:
        seen: set[str] = set()
        ahead = list(edges[start])
        while ahead:
            if (name := ahead.pop()) not in seen:
                seen.add(name)
                ahead += edges.get(name, ())
        reached[start] = seen
    knots: list[set[str]] = []
    for name in edges:
        if name in reached[name] and not any(name in knot for knot in knots):
            knots.append({other for other in reached[name] if name in reached.get(other, ())})
    return knots


def _sub_package(module: str) -> str:
    """The sub-package of its room that a module is in, or the module itself where it lies directly in the room."""
    root = next(root for root in ROOTS if module == root or module.startswith(f"{root}."))
    return ".".join(module.split(".")[: root.count(".") + 2])


def test_no_modules_import_each_other():
    assert _cycles(_edges()) == []


def test_no_sub_packages_import_each_other():
    modules = _modules()
    edges: dict[str, set[str]] = {}
    for name, targets in _edges().items():
        found = {_sub_package(target) for target in targets}
        edges.setdefault(_sub_package(name), set()).update(found - {_sub_package(name), *ROOTS})
    packages = {_sub_package(name) for name, path in modules.items() if path.name == "__init__.py"}
    assert [knot & packages for knot in _cycles(edges) if len(knot & packages) > 1] == []


def test_the_walk_sees_a_cycle():
    edges = {"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()}
    assert _cycles(edges) == [{"b", "c"}]


@pytest.mark.parametrize("room", ["dataset", "collect"])
def test_collecting_needs_no_heavy_package(room):
    # What a task offers to policies is torch modules, which nobody imports but who asks for a policy (next test).
    found = {
        str(path): {name.split(".")[0] for name in _imports(path)}
        & HEAVY - ({"torch"} if _is_for_policies(path) else set())
        for path in _files(room)
    }
    assert not {path: names for path, names in found.items() if names}


def _is_for_policies(path: Path) -> bool:
    return path.relative_to(ROOT).match("collect/copolicy/tasks/*/policy/*.py")


def test_a_task_imports_what_it_offers_to_policies_only_when_it_is_asked():
    """Nothing but the task itself, inside a function; so that collecting with a task needs no torch."""
    modules = _modules()
    offering = {name for name, path in modules.items() if _is_for_policies(path)}
    assert offering
    importing = {name for name, targets in _edges().items() if targets & offering} - offering
    assert {name.rpartition(".")[2] for name in importing} == {"task"}
    for name in importing:
        at_top = [
            node
            for node in ast.parse(modules[name].read_text(encoding="utf-8")).body
            if isinstance(node, ast.ImportFrom)
        ]
        assert not [node.module for node in at_top if "policy" in (node.module or "").split(".")]


def _called(function: ast.expr) -> str:
    """Names of a call, with dots; what is no name, such as a further call, is left out."""
    if isinstance(function, ast.Attribute):
        return f"{_called(function.value)}.{function.attr}"
    return function.id if isinstance(function, ast.Name) else ""


def _text_calls_without_encoding(path: Path) -> list[int]:
    """Lines on which a file is read or written as text in whatever encoding the locale has."""
    lines = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call) or any(keyword.arg == "encoding" for keyword in node.keywords):
            continue
        name = _called(node.func)
        method = name.rpartition(".")[2]
        modes = [argument.value for argument in node.args if isinstance(argument, ast.Constant)]
        modes += [keyword.value.value for keyword in node.keywords if isinstance(keyword.value, ast.Constant)]
        texts = {"r", "w", "a", "x", "r+", "w+"}.intersection(mode for mode in modes if isinstance(mode, str))
        if name.endswith((".read_text", ".write_text")) or (
            method in ("open", "fdopen") and texts and name != "av.open"
        ):
            lines.append(node.lineno)
    return lines


def test_text_is_utf8_whatever_the_locale():
    files = [path for folder in (*ROOMS, "tests") for path in (ROOT / folder).rglob("*.py")]
    found = {str(path.relative_to(ROOT)): _text_calls_without_encoding(path) for path in files}
    assert not {path: lines for path, lines in found.items() if lines}


def test_the_walk_sees_text_in_the_encoding_of_the_locale(tmp_path):
    path = tmp_path / "file.py"
    path.write_text("path.read_text()\npath.open('w')\npath.open('wb')\n", encoding="utf-8")
    assert _text_calls_without_encoding(path) == [1, 2]


def test_the_walk_sees_a_forbidden_import(tmp_path):
    path = tmp_path / "file.py"
    path.write_text(
        "def f():\n    from copolicy.train.cli import main\n    import lerobot_policy_copolicy\n", encoding="utf-8"
    )
    assert _rooms_imported(path) == {"train", "lerobot_policy_copolicy"}


@pytest.mark.parametrize("room", ROOMS)
def test_no_init_hides_the_other_rooms(room):
    assert not (ROOT / room / "copolicy" / "__init__.py").exists()


@pytest.mark.parametrize("room", ROOMS)
def test_no_module_lies_directly_in_a_source_root(room):
    assert not list((ROOT / room).glob("*.py"))


def test_the_top_level_is_the_fixed_one():
    allowed = {*ROOMS, "tests", "pyproject.toml", "README.md", "LICENSE", "uv.lock", "CHANGELOG.md", "CONTRIBUTING.md"}
    # Where there is no git (an unpacked archive) nothing untracked is expected either, but outputs may lie about.
    ignored = {"outputs", "dist"}
    found = {path.name for path in ROOT.iterdir() if not path.name.startswith(".")}
    assert found - ignored <= allowed
