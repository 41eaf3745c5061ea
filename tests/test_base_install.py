"""The installation without extras: help always works, what is missing is said in one line before any work."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from command_walk import SCRIPTS, every_command

from copolicy.dataset.command_line.extras import EXTRAS, require_packages
from copolicy.dataset.exceptions import MissingExtraError

WORKS = None
# A call of every command, and the package that it lacks.
CALLS: dict[str, tuple[str, str | None]] = {
    "copolicy-cards dataset": ("set --repo-id lab/table", "matplotlib"),
    "copolicy-cards model": ("pretrained", "matplotlib"),
    "copolicy-cards report": ("set --out report.html", WORKS),
    "copolicy-collect demo": ("--out demo.gif", "torch"),
    "copolicy-collect devices": ("", WORKS),
    "copolicy-collect maps check": ("maps.yaml", WORKS),
    "copolicy-collect maps make": ("--count 2 --out maps.yaml", WORKS),
    "copolicy-collect maps schema": ("", WORKS),
    "copolicy-collect maps show": ("maps.yaml --out maps.png", WORKS),
    "copolicy-collect play": ("--headless --players scripted policy:pretrained --out played", "torch"),
    "copolicy-collect recover": ("recordings", WORKS),
    "copolicy-collect replay": ("recordings/episode_000000.mcap --verify --out film.gif", "Pillow"),
    "copolicy-collect simulate": ("--episodes 1 --workers 1 --out simulated", WORKS),
    "copolicy-convert export": ("set --format minari --out table-v0", "h5py"),
    "copolicy-convert mcap": ("recordings --out new --repo-id lab/table", "lerobot"),
    "copolicy-convert merge": ("set set --out new --repo-id lab/table", "lerobot"),
    "copolicy-convert upstream": ("recordings --out new --repo-id lab/table", "lerobot"),
    "copolicy-dataset amend": ("set --set license=cc0-1.0", WORKS),
    "copolicy-dataset check": ("set", WORKS),
    "copolicy-dataset diff": ("set set", WORKS),
    "copolicy-dataset exclude": ("set --list", WORKS),
    "copolicy-dataset publish": ("set --repo-id lab/table", WORKS),
    "copolicy-dataset pull": ("lab/table --out new", WORKS),
    "copolicy-dataset release": ("set --bump major --notes first", WORKS),
    "copolicy-dataset select": ("set --out new --where success", WORKS),
    "copolicy-dataset split": ("set --out new --parts a=0.5 b=0.5", WORKS),
    "copolicy-dataset stats": ("set", WORKS),
    "copolicy-dataset withdraw": ("C-1 set", WORKS),
    "copolicy-eval behaviours": ("set --out seen", "Pillow"),
    "copolicy-eval compare": ("one.json other.json", WORKS),
    "copolicy-eval coplan": ("--policy pretrained --out eval/a.json", "torch"),
    "copolicy-eval cross-play": ("--robots pretrained --partners stubborn --out crossed", "torch"),
    "copolicy-eval figures": ("one.json --out drawn", "matplotlib"),
    "copolicy-eval human plan": ("A=pretrained B=pretrained --out study/plan.json", WORKS),
    "copolicy-eval human run": ("study/plan.json --participant P01 --human scripted --headless --out seen", "torch"),
    "copolicy-eval human summarise": ("recordings", WORKS),
    "copolicy-eval partner": ("pretrained --out eval/b.json", "torch"),
    "copolicy-eval partners make": ("--out partners", "lerobot"),
    "copolicy-eval plans": ("--policy pretrained --map 0 --out eval/plans.png", "torch"),
    "copolicy-eval power": ("--robots 5 --effect 0.14", "pingouin"),
    "copolicy-eval sweep": ("--runs pretrained --out swept", "torch"),
    "copolicy-eval table coplanning": ("--runs pretrained --out table", "torch"),
    "copolicy-eval table human": ("--recordings recordings --plan one.json --out human", WORKS),
    "copolicy-quickstart": ("--out quick", "lerobot"),
    "copolicy-train export": ("pretrained --out exported", "torch"),
    "copolicy-train pretrained": ("", WORKS),
}
MORE: list[tuple[str, str | None]] = [
    ("copolicy-train --dataset.root=set --steps=1 --output_dir=trained", "lerobot"),
    ("copolicy-dataset check recordings", WORKS),
    ("copolicy-eval compare --measurements trials.csv --factors robot", "pingouin"),
    ("copolicy-dataset check --rules", WORKS),
    ("copolicy-convert mcap recordings --out new --repo-id lab/table --video", "lerobot"),
    ("copolicy-quickstart --out quick --upstream recordings", "lerobot"),
]


def _walk(folder: Path, calls: list[str]) -> list[dict]:
    (folder / "calls.json").write_text(json.dumps([call.split() for call in calls]), encoding="utf-8")
    walk = Path(__file__).parent / "command_walk.py"
    done = subprocess.run(
        [sys.executable, walk, "calls.json"], cwd=folder, capture_output=True, text=True, env=dict(os.environ)
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


def test_every_command_is_walked():
    assert set(every_command()) == set(CALLS)


def test_help_and_version_need_no_extra(tmp_path):
    helps = [f"{command} --help" for command in (*SCRIPTS, *CALLS)]
    versions = [f"{script} --version" for script in SCRIPTS]
    for said in _walk(tmp_path, [*helps, *versions]):
        assert (said["status"], said["err"]) == (0, ""), said
        if said["words"][-1] == "--version":
            assert said["out"].startswith(f"{said['words'][0]} 0."), said
        else:
            assert said["out"].startswith("usage: "), said


def test_what_is_missing_is_one_line_before_any_work(sound_recordings, tmp_path):
    (tmp_path / "recordings").symlink_to(sound_recordings)
    (tmp_path / "set" / "meta").mkdir(parents=True)
    (tmp_path / "set" / "meta" / "info.json").write_text("{}", encoding="utf-8")
    for name in ("one", "other"):
        summary = {"study": "coplan", "policy": {}, "settings": {}, "summary": {}, "episodes": []}
        (tmp_path / f"{name}.json").write_text(json.dumps(summary), encoding="utf-8")
    calls = [*((f"{command} {flags}", lacks) for command, (flags, lacks) in CALLS.items()), *MORE]
    for said, (_, lacks) in zip(_walk(tmp_path, [call for call, _ in calls]), calls, strict=True):
        if lacks is WORKS:
            assert "is not installed" not in said["err"], said
            assert "Traceback" not in said["err"], said
            continue
        extra = "pip install 'lerobot_policy_copolicy[train]'"
        line = f"{said['words'][0]}: {lacks} is not installed: this command needs the extra, {extra}\n"
        assert (said["status"], said["out"], said["err"]) == (2, "", line), said
        assert said["left"] == [], said


@pytest.mark.usefixtures("sound")  # which makes the data set of the recordings
def test_a_data_set_is_read_without_extras(sound_recordings, tmp_path):
    shutil.copytree(sound_recordings.parent / "set", tmp_path / "data")
    calls = (
        "dataset check data",
        "dataset stats data",
        "dataset release data --bump major --notes first",
        "cards report data",
    )
    for said in _walk(tmp_path, [*(f"copolicy-{call}" for call in calls), "copolicy-cards dataset data --no-figures"]):
        assert said["status"] == 0, said
    assert (tmp_path / "data" / "report.html").stat().st_size > 10_000


@pytest.mark.parametrize(("package", "extra"), [("numba", "numba"), ("onnx", "onnx"), ("datatrove", "scale")])
def test_a_package_is_missed_with_its_own_extra(monkeypatch, package, extra):
    require_packages(*EXTRAS)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtraError, match=rf"^{package} is not installed: .*\[{extra}\]'$"):
        require_packages(package)
