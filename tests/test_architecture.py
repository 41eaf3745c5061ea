"""The arrows between rooms, and the two traps of one namespace over five source roots."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ROOMS = {
    "dataset": set(),
    "collect": {"dataset"},
    "convert": {"dataset", "collect"},
    "train": {"dataset", "collect"},
    "cards": {"dataset"},
}
HEAVY = {"torch", "torchvision", "lerobot", "datasets", "matplotlib", "pandas", "diffusers", "gymnasium"}


def _imports(path: Path) -> set[str]:
    """Absolute names that a file imports, at its top or inside a function."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def _rooms_imported(path: Path) -> set[str]:
    rooms = {name.split(".")[1] for name in _imports(path) if name.startswith("copolicy.")}
    return rooms | {"train" for name in _imports(path) if name.split(".")[0] == "lerobot_policy_copolicy"}


def _files(room: str) -> list[Path]:
    files = sorted((ROOT / room).rglob("*.py"))
    assert files, f"no source under {room}/"
    return files


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_imports_only_where_its_arrow_points(room):
    allowed = ROOMS[room] | {room}
    found = {str(path.relative_to(ROOT)): _rooms_imported(path) - allowed for path in _files(room)}
    assert not {path: rooms for path, rooms in found.items() if rooms}


@pytest.mark.parametrize("room", ["dataset", "collect"])
def test_collecting_needs_no_heavy_package(room):
    found = {str(path): {name.split(".")[0] for name in _imports(path)} & HEAVY for path in _files(room)}
    assert not {path: names for path, names in found.items() if names}


def test_the_walk_sees_a_forbidden_import(tmp_path):
    path = tmp_path / "file.py"
    path.write_text("def f():\n    from copolicy.train.coplan import coplan\n    import lerobot_policy_copolicy\n")
    assert _rooms_imported(path) == {"train"}


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
