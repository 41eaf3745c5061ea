"""Replay into files: video, GIF and contact sheet."""

import json
import math
import os
import subprocess
import sys

import av
import numpy as np
import pytest
from PIL import Image, ImageSequence

from copolicy.collect.cli import main
from copolicy.collect.replay.playback import Playback
from copolicy.collect.replay.sheet import draw_sheet, write_sheet
from copolicy.collect.replay.video import write_gif, write_video
from copolicy.collect.replay.view import ReplayView, ViewOptions
from copolicy.collect.sdl import pygame
from copolicy.dataset.exceptions import InvalidValueError, MissingExtraError, OutputExistsError


def pixels(surface):
    return pygame.surfarray.array3d(surface).swapaxes(0, 1)


def frames_of(path):
    container = av.open(str(path))
    frames = [np.asarray(one.to_ndarray(format="rgb24")) for one in container.decode(container.streams.video[0])]
    container.close()
    return frames


def test_a_video_shows_every_step(track, tmp_path):
    path = tmp_path / "out" / "episode.mp4"
    result = write_video(track, path, speed=8.0, width=301)
    frames = frames_of(path)
    assert len(frames) == result["frames"] == math.ceil(track.steps / 8) + 1 + 30
    assert frames[0].shape == (220, 300, 3)
    assert (np.abs(frames[0].astype(int) - frames[-1]).max(axis=2) > 60).sum() > 200
    drawn = pygame.Surface((300, 220), depth=32)
    ReplayView(track).draw(drawn, Playback(track.steps, position=0.0, speed=8.0), ViewOptions(hint=False))
    assert np.abs(pixels(drawn).astype(int) - frames[0]).mean() < 6
    assert [entry.name for entry in path.parent.iterdir()] == ["episode.mp4"]
    with pytest.raises(OutputExistsError):
        write_video(track, path)


def test_a_gif_runs_for_ever_at_its_speed(track, tmp_path):
    path = tmp_path / "episode.gif"
    result = write_gif(track, path, speed=8.0, width=240)
    with Image.open(path) as image:
        assert (image.size, image.info["loop"]) == ((240, 176), 0)
        duration = sum(frame.info["duration"] for frame in ImageSequence.Iterator(image))
    assert duration / 1000 == pytest.approx(result["seconds"], rel=0.05)


def test_each_of_several_files_is_written_or_none(recording, tmp_path, capsys):
    flags = ["--out", str(tmp_path / "a.png"), "--out"]
    assert main(["replay", str(recording), *flags, str(tmp_path / "b.png")]) == 2
    assert "--out: expected one file of each kind" in capsys.readouterr().err
    assert main(["replay", str(recording), *flags, str(tmp_path / "b.txt")]) == 2
    assert not list(tmp_path.iterdir())
    assert main(["replay", str(recording), *flags, str(tmp_path / "b.gif"), "--speed", "8", "--width", "300"]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "b.gif"]


def test_a_sheet_has_pictures_from_start_to_end(track, tmp_path):
    result = write_sheet(track, tmp_path / "sheet.png", frames=7, width=900)
    assert (result["steps"][0], result["steps"][-1], len(result["steps"])) == (0, track.steps, 7)
    surface = pygame.image.load(tmp_path / "sheet.png")
    assert list(surface.get_size()) == result["size"]
    drawn, _ = draw_sheet(track, 7, 900)
    assert (pixels(surface) == pixels(drawn)).all()
    with pytest.raises(OutputExistsError):
        write_sheet(track, tmp_path / "sheet.png")
    assert write_sheet(track, tmp_path / "one.png", frames=1)["steps"] == [0]


@pytest.mark.parametrize(
    ("write", "name", "options", "text"),
    [
        (write_video, "a.avi", {}, "expected a name that ends with .mp4 or .mkv, found '.avi'"),
        (write_gif, "a.mp4", {}, "expected a name that ends with .gif, found '.mp4'"),
        (write_sheet, "a.jpg", {}, "expected a name that ends with .png, found '.jpg'"),
        (write_video, "a.mp4", {"speed": 0.0}, "speed: expected 0.05 to 100, found 0.0"),
        (write_video, "a.mp4", {"fps": 500}, "fps: expected 1 to 120, found 500"),
        (write_video, "a.mp4", {"width": 100}, "width: expected 200 to 7680 px, found 100"),
        (write_sheet, "a.png", {"frames": 0}, "frames: expected 1 to 200, found 0"),
    ],
)
def test_what_makes_no_film_is_refused(track, tmp_path, write, name, options, text):
    with pytest.raises(InvalidValueError) as caught:
        write(track, tmp_path / name, **options)
    assert text in str(caught.value)
    assert not list(tmp_path.iterdir())


WITHOUT = """
import sys
for name in {blocked!r}:
    sys.modules[name] = None
from copolicy.collect.cli import main
sys.exit(main(sys.argv[1:]))
"""


def run_without(blocked, *arguments, **environment):
    """The command in a process where some packages cannot be imported."""
    script = WITHOUT.format(blocked=blocked)
    clean = {name: value for name, value in os.environ.items() if not name.startswith("SDL_")}
    return subprocess.run(
        [sys.executable, "-c", script, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env=clean | environment,
    )


ENCODER = """#!{python}
import sys
data = sys.stdin.buffer.read()
if {fails}:
    print("Unknown encoder 'libx264'", file=sys.stderr)
    sys.exit(1)
open(sys.argv[-1], "wb").write(b"%d %s" % (len(data), " ".join(sys.argv).encode()))
"""


def fake_ffmpeg(folder, fails=False):
    """A program named ffmpeg that tells what it was given; the real one is not on every machine."""
    folder.mkdir()
    program = folder / "ffmpeg"
    program.write_text(ENCODER.format(python=sys.executable, fails=fails), encoding="utf-8")
    program.chmod(0o755)
    return str(folder)


def test_without_pyav_the_program_ffmpeg_is_asked(recording, tmp_path):
    out = tmp_path / "a.mp4"
    run = run_without(
        ["av"], "replay", recording, "--out", out, "--speed", "8", "--width", "300", "--json",
        PATH=fake_ffmpeg(tmp_path / "bin"),
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    result = json.loads(run.stdout)["video"]
    size, *command = out.read_text(encoding="utf-8").split()
    assert int(size) == result["frames"] * 300 * 220 * 3
    assert command[command.index("-s") + 1] == "300x220"
    failing = fake_ffmpeg(tmp_path / "bad", fails=True)
    run = run_without(["av"], "replay", recording, "--out", tmp_path / "b.mp4", "--speed", "8", PATH=failing)
    assert run.returncode == 1
    assert run.stderr == (
        "copolicy-collect: b.mp4: expected ffmpeg to encode the video, found Unknown encoder 'libx264'\n"
    )
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["a.mp4", "bad", "bin"]


@pytest.mark.parametrize(
    ("blocked", "name", "text"),
    [
        (["av"], "a.mp4", "video: expected PyAV (pip install av) or the program ffmpeg, found neither"),
        (["PIL"], "a.gif", str(MissingExtraError("Pillow"))),
        (["rerun"], "a.rrd", "Rerun: expected the package rerun-sdk, found none: pip install rerun-sdk"),
    ],
)
def test_a_missing_package_is_one_line(recording, tmp_path, blocked, name, text):
    run = run_without(blocked, "replay", recording, "--out", tmp_path / name, PATH="")
    assert (run.returncode, run.stderr) == (2, f"copolicy-collect: {text}\n")
    assert not list(tmp_path.iterdir())


def test_pictures_need_no_display(recording, tmp_path):
    run = run_without([], "replay", recording, "--out", tmp_path / "a.png", "--json", SDL_VIDEODRIVER="none")
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["png"]["out"] == str(tmp_path / "a.png")
    run = run_without([], "replay", recording, SDL_VIDEODRIVER="none")
    assert run.returncode == 1
    assert "expected a display (or --out FILE), found none" in run.stderr
