"""The wheel as it is built: marked as typed, nothing astray, and a description that stands alone on the index."""

import re
import subprocess
import sys
import zipfile
from email import message_from_bytes
from email.message import Message
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ROOMS = ("dataset", "collect", "convert", "train", "cards")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> zipfile.ZipFile:
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    done = subprocess.run(build, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    (path,) = folder.glob("*.whl")
    return zipfile.ZipFile(path)


@pytest.fixture(scope="module")
def metadata(wheel) -> Message:
    (name,) = (name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
    return message_from_bytes(wheel.read(name))


def test_every_package_is_marked_as_typed(wheel):
    marked = {name for name in wheel.namelist() if name.endswith("py.typed")}
    packages = (*ROOMS, "tasks", "evaluate")
    assert marked == {*(f"copolicy/{package}/py.typed" for package in packages), "lerobot_policy_copolicy/py.typed"}


def test_nothing_lands_beside_the_packages(wheel):
    tops = {name.split("/")[0] for name in wheel.namelist()}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"copolicy", "lerobot_policy_copolicy"}
    assert "copolicy/__init__.py" not in wheel.namelist()


def test_the_description_shows_and_links_to_nothing_that_the_index_lacks(metadata):
    assert metadata["Description-Content-Type"] == "text/markdown"
    text = metadata.get_payload(decode=True).decode("utf-8")  # pyright: ignore[reportAttributeAccessIssue]
    targets = re.findall(r"\]\(([^)\s]*)", text) + re.findall(r"(?:src|href)=[\"']([^\"']*)", text)
    assert targets
    assert [target for target in targets if not target.startswith("https://")] == []
    assert not re.search(r"^\s*\|( \|)+\s*$", text, re.MULTILINE), "a table of images without images"
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    headings = re.findall(r"^#+ .*$", readme, re.MULTILINE)
    assert [line for line in headings if line not in text] == []
    for block in re.findall(r"^```bash\n.*?^```", readme, re.MULTILINE | re.DOTALL):
        assert block in text


def test_the_metadata_name_addresses_and_scripts(wheel, metadata):
    addresses = [address.split(", ")[1] for address in metadata.get_all("Project-URL") or ()]
    assert addresses
    assert all(address.startswith("https://") for address in addresses)
    assert "Typing :: Typed" in (metadata.get_all("Classifier") or ())
    (name,) = (name for name in wheel.namelist() if name.endswith(".dist-info/entry_points.txt"))
    scripts = re.findall(r"^(copolicy-\w+) = ", wheel.read(name).decode("utf-8"), re.MULTILINE)
    assert set(scripts) == {
        f"copolicy-{name}" for name in ("cards", "collect", "convert", "dataset", "eval", "quickstart", "train")
    }
