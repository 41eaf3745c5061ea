"""Replay: the track of a recording, its playback, the image and the window."""

from dataclasses import replace

import numpy as np
import pytest

from copolicy.collect.replay.playback import Playback
from copolicy.collect.replay.track import frame_positions, read_track
from copolicy.collect.replay.view import SIZE, ReplayView, ViewOptions
from copolicy.collect.replay.viewer import Viewer
from copolicy.collect.sdl import pygame
from copolicy.dataset.exceptions import FileFormatError
from copolicy.tasks.table.interaction import interaction_force


def pixels(surface):
    return pygame.surfarray.array3d(surface).swapaxes(0, 1)


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
