"""The model that comes with the package: found, loaded, played with, filmed. Whichever weights it has."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence
from play_session import SHORT_MAP, settings
from safetensors import safe_open

from copolicy.collect.agents.checkpoint_folder import checkpoint_folder, load_policy, pretrained_folder
from copolicy.collect.cli import main as collect
from copolicy.collect.demonstration.video import demonstrate
from copolicy.collect.play.session_run import prepared
from copolicy.collect.play.settings import PlayerSpec
from copolicy.collect.session import BalancedSchedule
from copolicy.dataset.exceptions import FileFormatError, MissingExtraError
from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.dataset.recording.reader import read_episode
from copolicy.evaluate.cli import main as evaluate
from copolicy.tasks.table.features import environment_state, state_vector
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.train.checkpoint import Checkpoint
from copolicy.train.cli import main as train

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "train" / "lerobot_policy_copolicy" / "pretrained"


@pytest.fixture(scope="module")
def shipped() -> Checkpoint:
    return Checkpoint("pretrained")


def test_the_folder_is_small_and_no_machines_path_is_in_it():
    assert pretrained_folder().samefile(FOLDER)
    files = {path.name: path for path in FOLDER.iterdir()}
    assert {"config.json", "model.safetensors", "recipe.json", "README.md"} <= files.keys()
    assert sum(path.stat().st_size for path in files.values()) < 8e6
    for name, path in files.items():
        if path.suffix in (".json", ".md"):
            text = path.read_text(encoding="utf-8")
            assert not [place for place in ("/home/", "/root/", "/tmp/", "/work/", "/Users/") if place in text], name


def test_it_holds_the_averaged_weights_alone():
    assert json.loads((FOLDER / "config.json").read_text(encoding="utf-8"))["ema"] is False
    assert json.loads((FOLDER / "recipe.json").read_text(encoding="utf-8"))["weights"]["averaged"] is True
    with safe_open(FOLDER / "model.safetensors", "np") as weights:
        names = list(weights.keys())
        assert {str(weights.get_tensor(name).dtype) for name in names} == {"float32"}
    assert [name for name in names if not name.startswith("denoiser.")] == []


def test_git_and_the_wheel_take_it():
    if (ROOT / ".git").exists():
        ignored = subprocess.run(
            ["git", "check-ignore", "--no-index", *map(str, FOLDER.iterdir())], cwd=ROOT, capture_output=True, text=True
        )
        assert (ignored.returncode, ignored.stdout) == (1, "")
    wheel = (
        (ROOT / "pyproject.toml")
        .read_text(encoding="utf-8")
        .partition("[tool.hatch.build.targets.wheel]")[2]
        .partition("[tool.")[0]
    )
    assert '"train"' in wheel.partition("only-include")[2].partition("\n")[0]
    assert (
        'exclude = ["/*/README.md", "/*/docs", "/*/examples"]' in wheel
    )  # of the rooms: not the model's own card, three folders down


def test_the_name_is_not_taken_for_a_folder_of_the_same_name(tmp_path, monkeypatch):
    (tmp_path / "pretrained").mkdir()
    monkeypatch.chdir(tmp_path)
    assert checkpoint_folder("pretrained").samefile(FOLDER)
    assert checkpoint_folder(Path("pretrained")).samefile(FOLDER)
    with pytest.raises(FileFormatError, match=r"expected a checkpoint folder with config\.json and model\.safetensors"):
        checkpoint_folder(tmp_path / "pretrained")


def test_an_installation_without_it_is_told_so(tmp_path):
    package = tmp_path / "lerobot_policy_copolicy"
    package.mkdir()
    (package / "__init__.py").touch()
    code = """
from copolicy.collect.agents.checkpoint_folder import pretrained_folder
from copolicy.dataset.exceptions import FileFormatError
try:
    pretrained_folder()
except FileFormatError as error:
    print(error)
"""
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == (
        f"{package / 'pretrained'}: expected the model that comes with the package, found none named config.json and "
        "model.safetensors; reinstall lerobot_policy_copolicy, or name a checkpoint of your own"
    )


def test_without_the_extra_it_is_one_clear_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(MissingExtraError):
        load_policy("pretrained")
    flags = ["--out", str(tmp_path), "--headless", "--players", "scripted", "policy:pretrained"]
    assert collect(["play", *flags]) == 2
    assert capsys.readouterr().err == (
        "copolicy-collect: torch is not installed: this command needs the extra, "
        "pip install 'lerobot_policy_copolicy[train]'\n"
    )


def test_it_plans_for_both_players(shipped):
    config = MAP_SETS["unseen"][0]
    frames = shipped.n_obs_steps
    history = {
        STATE: np.tile(state_vector(config.start, (0.0, 0.0, 0.0)), (1, frames, 1)),
        ENVIRONMENT_STATE: np.tile(environment_state(config), (1, frames, 1)),
        HUMAN_ACTION: np.zeros((1, frames, 2)),
    }
    plan = shipped.predict_action_chunk(history)
    assert plan.shape == (1, shipped.chunk_size, 4)
    assert np.abs(plan).max() <= 1
    assert np.abs(plan).mean() > 0.01, "a policy that plans rest was not trained"


def test_with_a_simulated_partner_it_finishes_an_easy_map(shipped):
    track = demonstrate(shipped, SHORT_MAP)
    assert track.episode.meta.termination_reason == "goal"
    assert track.episode.meta.controller_0 == shipped.name
    assert track.episode.meta.controller_1 == "scripted:S01"
    # The robot carries too: it is no partner's work alone.
    assert np.abs(track.episode.actions[:, :2]).mean() > 0.1
    again = demonstrate(shipped, SHORT_MAP)
    np.testing.assert_array_equal(track.episode.actions, again.episode.actions)


@pytest.mark.parametrize("players", [("scripted", "policy:pretrained"), ("policy:pretrained", "scripted")])
def test_it_plays_on_the_robots_seat_in_real_time(tmp_path, players):
    """In whichever order the two are named: it learned the robot's half of the plans."""
    specs = tuple(map(PlayerSpec.parse, players))
    with prepared(settings(tmp_path, players=specs, episodes=1, headless=True)) as application:
        game = application.game
        assert game.seats()[0].spec.kind == "policy"
        game.scenarios = (SHORT_MAP,)
        game.schedule = BalancedSchedule(game.scenarios, 1, 0, "P01", swap=False, seating=int(players[0] == "scripted"))
        application.run()
    (recorded,) = tmp_path.rglob("*.mcap")
    episode = read_episode(recorded)
    assert episode.meta.controller_0.startswith("policy:copolicy-")
    assert episode.meta.controller_1 == "scripted:S01"
    assert np.abs(episode.actions[:, :2]).max() > 0.05


def test_the_studies_know_it_by_name(tmp_path, capsys):
    flags = ["--limit", "1", "--step-limit", "30", "--out", str(tmp_path / "eval.json"), "--json"]
    assert evaluate(["coplan", "--policy", "pretrained", *flags]) == 0
    assert json.loads(capsys.readouterr().out)["episodes"] == 1
    assert train(["pretrained", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert Path(said["path"]).samefile(FOLDER)
    assert (Path(said["path"]) / "config.json").is_file()


def test_a_film_of_it(tmp_path, capsys):
    film = tmp_path / "demo.gif"
    flags = ["--out", str(film), "--width", "240", "--fps", "4", "--speed", "8", "--map", "0", "1", "--json"]
    assert collect(["demo", *flags]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert [line.split(":")[0] for line in summary["episodes"]] == ["unseen 0", "unseen 1"]
    assert summary["partner"] == "simulated, human of S01"
    with Image.open(film) as image:
        assert image.size == (240, 138)
        assert 10 < len(list(ImageSequence.Iterator(image))) <= summary["frames"]
    assert collect(["demo", *flags]) == 2
    assert "expected a path that does not exist yet" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--map", "84"], "--map: expected 0 to 83, found 84"),
        (["--fps", "0"], "--fps: expected 1 to 50, found 0"),
        (["--out", "demo.mp4"], "--out: expected a name that ends with .gif, found 'demo.mp4'"),
        (["--policy", "nowhere"], "nowhere: expected a checkpoint folder with config.json and model.safetensors"),
    ],
)
def test_wrong_calls_of_the_film(tmp_path, capsys, flags, message):
    assert collect(["demo", "--out", str(tmp_path / "demo.gif"), *flags]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
