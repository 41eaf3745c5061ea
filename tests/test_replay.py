"""Replay: window, video, GIF, contact sheet, verification and Rerun."""

import json
import math
import os
import subprocess
import sys
from dataclasses import replace

import av
import numpy as np
import pytest
from PIL import Image, ImageSequence
from straight_carry import record

from copolicy.collect.cli import main
from copolicy.collect.replay.playback import Playback
from copolicy.collect.replay.sheet import draw_sheet, write_sheet
from copolicy.collect.replay.track import frame_positions, read_track
from copolicy.collect.replay.verify import verify
from copolicy.collect.replay.video import write_gif, write_video
from copolicy.collect.replay.view import SIZE, ReplayView, ViewOptions
from copolicy.collect.replay.viewer import Viewer
from copolicy.collect.sdl import pygame
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, MissingExtraError, OutputExistsError
from copolicy.tasks.table.interaction import interaction_force
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return record(tmp_path_factory.mktemp("replay") / "episode.mcap")


@pytest.fixture(scope="module")
def track(recording):
    return read_track(recording)


def pixels(surface):
    return pygame.surfarray.array3d(surface).swapaxes(0, 1)


# The track and the playback


def test_a_track_has_every_state_force_and_event(track):
    states = np.vstack((track.episode.states, track.episode.final_state))
    assert len(track.poses) == track.steps + 1 == len(states)
    assert np.allclose([pose[:2] for pose in track.poses], states[:, :2], rtol=0, atol=0)
    assert (track.forces[:-1] == track.episode.actions).all()
    assert track.forces_at(track.steps) == (0.0, 0.0, 0.0, 0.0)
    thetas = np.array([pose[2] for pose in track.poses])
    assert track.interaction == pytest.approx(interaction_force(thetas[1:], track.episode.actions))
    assert [(event.step, event.kind, event.detail) for event in track.events] == [(40, "pause", "focus lost")]


def test_between_two_states_the_table_is_between_them(track):
    (x0, y0, _), (x1, y1, _) = track.poses[10], track.poses[11]
    x, y, _ = track.pose_at(10.25)
    assert (x, y) == pytest.approx((x0 + 0.25 * (x1 - x0), y0 + 0.25 * (y1 - y0)))
    assert track.pose_at(track.steps) == pytest.approx(track.poses[-1])
    assert track.pose_at(10.0) == pytest.approx(track.poses[10])


@pytest.mark.parametrize(("fps", "speed", "stride"), [(30, 1.0, 1.0), (60, 1.0, 0.5), (30, 4.0, 4.0), (12, 1.0, 2.5)])
def test_frames_of_a_film_are_evenly_spaced_and_end_at_the_end(track, fps, speed, stride):
    positions = frame_positions(track, fps, speed)
    assert np.allclose(np.diff(positions[:-1]), stride)
    assert positions[-1] == track.steps
    assert positions[-2] < track.steps


def test_a_recording_that_broke_off_is_sent_to_recover(recording, tmp_path):
    part = tmp_path / "episode.mcap.part"
    part.write_bytes(recording.read_bytes()[:3000])
    with pytest.raises(FileFormatError, match=r"found an unfinished one \(see copolicy-collect recover\)"):
        read_track(part)


def test_playback_moves_with_time_and_stops_at_the_end():
    playback = Playback(100)
    playback.advance(0.5)
    assert playback.position == 15.0
    playback.change_speed(1)
    playback.advance(1.0)
    assert (playback.speed, playback.position, playback.playing) == (2.0, 75.0, True)
    playback.advance(10.0)
    assert (playback.position, playback.playing) == (100.0, False)
    playback.toggle()
    assert (playback.position, playback.playing) == (0.0, True)


@pytest.mark.parametrize(
    ("start", "count", "after"), [(10.4, 1, 11), (10.4, -1, 10), (10, -1, 9), (0, -1, 0), (99, 30, 100)]
)
def test_single_steps_go_from_state_to_state(start, count, after):
    playback = Playback(100, position=start)
    playback.step(count)
    assert (playback.position, playback.playing) == (after, False)


def test_speed_has_ends():
    playback = Playback(10)
    for _ in range(20):
        playback.change_speed(1)
    assert playback.speed == 8.0
    for _ in range(20):
        playback.change_speed(-1)
    assert playback.speed == 0.1


# The picture and the window


def test_the_picture_shows_the_table_where_it_is(track):
    surface = pygame.Surface(SIZE, depth=32)
    view = ReplayView(track)
    view.draw(surface, Playback(track.steps), ViewOptions(trails=False, forces=False, hint=False))
    start = pixels(surface).copy()
    view.draw(surface, Playback(track.steps, position=track.steps), ViewOptions(trails=False, forces=False, hint=False))
    end = pixels(surface)
    x, y, _ = track.poses[0]
    board = (round(y) + 60, round(x))
    assert tuple(start[board]) != tuple(end[board])
    wood = np.abs(end[:, :, :].astype(int) - (178, 132, 88)).sum(axis=2) < 6
    rows, columns = np.nonzero(wood[60:660])
    assert columns.mean() == pytest.approx(track.poses[-1][0], abs=6)
    assert rows.mean() == pytest.approx(track.poses[-1][1], abs=6)


@pytest.mark.parametrize("switch", ["trails", "forces", "help", "hint", "message"])
def test_each_switch_changes_the_picture(track, switch):
    surface = pygame.Surface(SIZE, depth=32)
    view = ReplayView(track)
    playback = Playback(track.steps, position=60.0)
    view.draw(surface, playback, ViewOptions())
    before = pixels(surface).copy()
    value = "saved" if switch == "message" else not getattr(ViewOptions(), switch)
    view.draw(surface, playback, replace(ViewOptions(), **{switch: value}))
    assert (pixels(surface) != before).any()


@pytest.mark.parametrize("size", [(40, 30), (640, 480), (300, 1400), (2400, 700)])
def test_any_size_of_window_is_drawn(track, size):
    surface = pygame.Surface(size, depth=32)
    view = ReplayView(track)
    for position in (0.0, 33.3, track.steps):
        view.draw(surface, Playback(track.steps, position=position), ViewOptions(help=True))
    assert len(np.unique(pixels(surface).reshape(-1, 3), axis=0)) > 20


class Clock:
    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def viewer(track):
    pygame.display.quit()
    viewer = Viewer(track, Clock())
    viewer.draw()
    yield viewer
    pygame.display.quit()


def press(viewer, key, mod=0):
    viewer.handle(pygame.event.Event(pygame.KEYDOWN, key=key, mod=mod))


def mouse(viewer, kind, point):
    viewer.handle(pygame.event.Event(kind, pos=point, button=1))


def test_keys_play_step_and_change_speed(viewer, track):
    press(viewer, pygame.K_SPACE)
    assert not viewer.playback.playing
    press(viewer, pygame.K_RIGHT)
    press(viewer, pygame.K_RIGHT, pygame.KMOD_LSHIFT)
    assert viewer.playback.position == 31
    press(viewer, pygame.K_LEFT)
    assert viewer.playback.position == 30
    viewer.handle(pygame.event.Event(pygame.MOUSEWHEEL, y=-1))
    assert viewer.playback.position == 0
    press(viewer, pygame.K_UP)
    assert viewer.playback.speed == 2.0
    press(viewer, pygame.K_DOWN)
    press(viewer, pygame.K_END)
    assert (viewer.playback.speed, viewer.playback.position) == (1.0, track.steps)
    press(viewer, pygame.K_HOME)
    press(viewer, pygame.K_t)
    press(viewer, pygame.K_f)
    press(viewer, pygame.K_h)
    viewer.draw()
    assert (viewer.options.trails, viewer.options.forces, viewer.options.help) == (False, False, True)
    press(viewer, pygame.K_ESCAPE)
    assert (viewer.options.help, viewer.open) == (False, True)
    press(viewer, pygame.K_ESCAPE)
    assert not viewer.open


def test_the_mouse_scrubs_while_it_is_held(viewer, track):
    width, height = pygame.display.get_surface().get_size()
    scale = min(width / SIZE[0], height / SIZE[1])
    left, top = (width - SIZE[0] * scale) / 2, (height - SIZE[1] * scale) / 2

    def at(share, y):
        return round(left + (186 + 828 * share) * scale), round(top + y * scale)

    mouse(viewer, pygame.MOUSEBUTTONDOWN, at(0.5, 824))
    assert viewer.playback.position == pytest.approx(track.steps / 2, abs=1)
    viewer.advance(5.0)
    assert viewer.playback.position == pytest.approx(track.steps / 2, abs=1)
    mouse(viewer, pygame.MOUSEMOTION, at(0.25, 300))  # held, it may leave the line
    assert viewer.playback.position == pytest.approx(track.steps / 4, abs=1)
    mouse(viewer, pygame.MOUSEMOTION, at(-3.0, 824))
    assert viewer.playback.position == 0
    mouse(viewer, pygame.MOUSEBUTTONUP, at(0.25, 300))
    assert viewer.playback.playing
    mouse(viewer, pygame.MOUSEMOTION, at(0.9, 824))
    assert viewer.playback.position == 0
    mouse(viewer, pygame.MOUSEBUTTONDOWN, at(0.75, 740))  # on the graph
    mouse(viewer, pygame.MOUSEBUTTONUP, at(0.75, 740))
    assert viewer.playback.position == pytest.approx(0.75 * track.steps, abs=1)
    mouse(viewer, pygame.MOUSEBUTTONDOWN, at(0.5, 300))  # on the world
    assert not viewer.playback.playing


def test_a_picture_is_saved_beside_the_recording_and_none_overwritten(recording, tmp_path):
    path = tmp_path / "mine.mcap"
    path.write_bytes(recording.read_bytes())
    pygame.display.quit()
    clock = Clock()
    viewer = Viewer(read_track(path), clock)
    for _ in range(2):
        press(viewer, pygame.K_s)
    assert viewer.options.message == "saved mine_step_0000-2.png"
    clock.now = 10.0
    viewer.advance(0.0)
    assert viewer.options.message == ""
    assert sorted(entry.name for entry in tmp_path.iterdir()) == [
        "mine.mcap", "mine_step_0000-2.png", "mine_step_0000.png",
    ]  # fmt: skip
    pygame.display.quit()


def test_the_window_runs_until_it_is_closed(track):
    pygame.display.quit()
    viewer = Viewer(track)
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_END, mod=0))
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    viewer.run()
    assert viewer.playback.position == track.steps
    assert not pygame.display.get_init()


# Films and pictures


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


# The check


def test_a_recording_of_this_world_is_reproduced(track):
    result = verify(track)
    assert result["reproduced"]
    assert result["exit_status"] == 0
    assert result["max_drift_px"] < 1e-9
    assert result["max_drift_rad"] < 1e-12
    assert result["first_step_beyond"] is None
    assert result["recorded_end"] == result["simulated_end"] == f"goal after {track.steps} steps"


def test_the_bound_of_the_angular_acceleration_is_the_recorded_one(tmp_path):
    config = MapConfig((400.0, 300.0, 1.0), (1000.0, 100.0))
    eighth = Physics(angular_acceleration_limit=math.pi / 8)
    path = record(tmp_path / "eighth.mcap", 90, eighth, config, push=(1.0, 0.2, -1.0, 0.3))
    track = read_track(path)
    result = verify(track)
    assert (result["angular_limit"], result["reproduced"]) == (math.pi / 8, True)
    result = verify(track, "pi/2")
    assert (result["reproduced"], result["exit_status"]) == (False, 1)
    assert result["max_drift_rad"] > 0.01
    assert 0 < result["first_step_beyond"] < 90


def test_a_state_that_the_actions_do_not_lead_to_is_found(track):
    states = track.episode.states.copy()
    states[50:, 0] += 0.02
    bent = replace(track, episode=replace(track.episode, states=states))
    result = verify(bent)
    assert (result["reproduced"], result["first_step_beyond"]) == (False, 50)
    assert result["max_drift_px"] == pytest.approx(0.02)
    assert verify(bent, limit_px=0.05)["reproduced"]


def test_an_end_that_the_world_does_not_see_is_found(track):
    meta = replace(track.episode.meta, termination_reason="collision_obstacle")
    result = verify(replace(track, episode=replace(track.episode, meta=meta)))
    assert result["max_drift_px"] < 1e-9
    assert (result["reproduced"], result["simulated_end"]) == (False, f"goal after {track.steps} steps")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"angular_limit": "pi"}, "angular limit: expected one of ['pi/2', 'pi/8'], found 'pi'"),
        ({"limit_px": 0.0}, "limit in px: expected a positive number, found 0.0"),
    ],
)
def test_limits_that_cannot_be(track, options, text):
    with pytest.raises(InvalidValueError) as caught:
        verify(track, **options)
    assert str(caught.value) == text


def test_the_command_checks_and_its_exit_status_tells(recording, tmp_path, capsys):
    assert main(["replay", str(recording), "--verify", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verify"]["reproduced"] is True
    assert main(["replay", str(recording), "--verify", "--max-drift-px", "1e-300", "--max-drift-rad", "1e-300"]) == 1
    assert "first_step_beyond" in capsys.readouterr().out
    assert main(["replay", str(tmp_path / "none.mcap"), "--verify"]) == 2
    assert "expected a readable MCAP file, found No such file or directory" in capsys.readouterr().err
    record(tmp_path / "empty.mcap", 1)
    assert main(["replay", str(tmp_path / "empty.mcap"), "--verify"]) == 0
