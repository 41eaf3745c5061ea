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
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
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


def _text_calls_without_encoding(path: Path) -> list[int]:
    """Lines on which a file is read or written as text in whatever encoding the locale has."""
    lines = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call) or any(keyword.arg == "encoding" for keyword in node.keywords):
            continue
        name = ast.unparse(node.func)
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
        "def f():\n    from copolicy.train.coplan import coplan\n    import lerobot_policy_copolicy\n", encoding="utf-8"
    )
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
