"""Two people with real (virtual) joysticks, from the lobby to the end, and back on another day.

Sessions with a lobby follow a simulated clock; without one, and where the window is closed, they follow the machine's.
"""

import json
import math

import numpy as np
import pytest
from mcap.reader import make_reader
from play_session import SHORT_MAP, A, B, Players, SimulatedClock, X, on_short_map, settings
from virtual_joystick import VirtualJoystick

from copolicy.collect.play.session_run import prepared
from copolicy.collect.sdl import pygame
from copolicy.collect.ticker import DT_NS
from copolicy.dataset.recording.messages.copolicy_pb2 import EpisodeEvent, LoopTiming, PlayerInput
from copolicy.dataset.recording.reader import read_episode, read_metadata


@pytest.fixture
def gamepads():
    pygame.display.init()
    virtual = [VirtualJoystick("Alpha pad", product=1), VirtualJoystick("Beta pad", product=2)]
    yield virtual
    for gamepad in virtual:
        gamepad.unplug()
    pygame.joystick.quit()


def _messages(path, topic, message):
    with path.open("rb") as file:
        return [message.FromString(one.data) for _, _, one in make_reader(file).iter_messages([topic])]


def _events(path):
    return [(event.kind, event.detail) for event in _messages(path, "/episode/event", EpisodeEvent)]


def _join_and_start(players, a, b):
    players.phase("Lobby")
    for gamepad in (a, b):
        players.press(gamepad, A)  # joins
    for gamepad in (a, b):
        players.press(gamepad, A)  # agrees
    players.phase("Ready")
    players.press(a, A)
    players.phase("Running")


def _run(application, play):
    on_short_map(application)
    players = Players(application, play)
    players.start()
    try:
        application.run()
    finally:
        players.finish()
    return application.summary()


def test_a_session_from_the_lobby_to_the_next_day(tmp_path, gamepads):
    a, b = gamepads
    spare = []

    def first_day(players):
        game = players.application.game
        players.phase("Lobby")
        players.press(b, A)
        assert game.players[0].label == "Beta pad", "the first press takes the first seat"
        players.press(a, A)
        # Player b (gamepad a) calibrates: B goes down the menu, A chooses.
        players.press(a, B)
        players.press(a, B)
        players.press(a, A)
        a.move(0.1, 0.0)  # rests off its centre
        players.sleep(1.4)
        for step in range(170):
            a.move(0.1 + 0.8 * math.cos(step / 12), 0.8 * math.sin(step / 12))
            players.sleep(0.015)
        a.move(0.1, 0.0)
        players.sleep(0.1)
        players.until(lambda: (tmp_path / "config" / "calibrations.json").exists(), "the calibration on the disk")
        assert game.players[1].person.force(game.players[1].person.sample()) == (0.0, 0.0)
        for _ in range(7):
            players.press(a, B)  # round to the first item
        # Swapped in the lobby: seats change, not the players' devices.
        for _ in range(6):
            players.press(b, B)
        players.press(b, A)
        assert [player.player_id for player in game.seats()] == ["P01-b", "P01-a"]
        for _ in range(3):
            players.press(b, B)
        players.press(a, A)
        players.press(b, A)
        players.phase("Ready")
        players.press(a, A)
        players.phase("Running")
        players.carry(a, b, steps=20)
        # In the middle of it somebody pulls the cable.
        b.unplug()
        players.phase("Paused")
        steps = game.trial.steps
        players.press(a, A)  # nobody can go on without a device
        players.sleep(0.3)
        assert type(players.application.phase).__name__ == "Paused"
        assert game.trial.steps == steps
        spare.append(VirtualJoystick("Beta pad", product=2))
        assert spare[0].instance_id != b.instance_id
        players.press(spare[0], A)  # joins again
        assert game.roster.without_device() == []
        players.press(a, A)
        players.phase("Running")
        players.carry(a, spare[0])
        players.result()
        players.press(a, X)  # redo
        players.phase("Ready")
        players.press(a, A)
        players.phase("Running")
        players.carry(a, spare[0])
        players.result()
        players.press(a, A)  # keep
        players.phase("Ready")
        players.press(a, 6)  # to the last item of the menu: quit for now
        players.press(a, A)

    try:
        with prepared(settings(tmp_path, consents=("C-17", "C-18")), clock=SimulatedClock(2)) as application:
            summary = _run(application, first_day)
    finally:
        for gamepad in spare:
            gamepad.unplug()
    assert summary["ended_by"] == "quit"
    assert (summary["kept"], summary["discarded"], summary["outcomes"]) == (1, 1, {"goal": 2})
    assert summary["complete"] is False

    folder = tmp_path / "recordings" / "P01-01"
    redone, kept = (read_episode(folder / f"episode_00{number}.mcap") for number in range(2))
    assert not list(folder.glob("*.part"))
    for episode in (redone, kept):
        meta = episode.meta
        assert (meta.success, meta.termination_reason, meta.source) == (True, "goal", "human")
        assert (meta.player_0_id, meta.player_1_id) == ("P01-b", "P01-a")
        assert (meta.controller_0, meta.controller_1) == ("joystick", "joystick")
        assert meta.consent_id == "C-18,C-17"
        assert episode.map_config == SHORT_MAP
    assert (redone.meta.discarded, kept.meta.discarded) == (True, False)
    assert "paused" in redone.meta.quality_flags.split(",")
    kinds = [kind for kind, _ in _events(folder / "episode_000.mcap")]
    middle = ["device_lost", "pause", "resume", "outcome", "verdict"]
    assert [kind for kind in kinds if kind in middle] == middle
    records = read_metadata(folder / "episode_000.mcap")
    assert records["devices"]["seat_0_device"] == "Alpha pad"
    assert records["episode_result"]["notes"] == "discarded: redo"
    (calibration,) = json.loads((tmp_path / "config" / "calibrations.json").read_text(encoding="utf-8")).values()
    assert calibration["centre"] == pytest.approx([0.1, 0.0], abs=1e-3)
    assert calibration["low"] == pytest.approx([-0.7, -0.8], abs=0.03)
    assert str(tmp_path) not in (folder / "session.json").read_text(encoding="utf-8") + (
        folder / "journal.jsonl"
    ).read_text(encoding="utf-8")

    # Every step has its own reading of the stick, and what was read is what acted.
    path = folder / "episode_001.mcap"
    inputs = _messages(path, "/player/1/input", PlayerInput)
    timings = _messages(path, "/loop/timing", LoopTiming)
    assert [record.step for record in inputs] == [record.step for record in timings] == list(range(len(kept.actions)))
    raw = np.array([record.axes[:2] for record in inputs])
    size = np.hypot(*raw.T)
    deflected = size > 0.13
    assert deflected.sum() > 20
    expected = raw * np.where(deflected, (size - 0.12) / 0.88 / np.maximum(size, 1e-9), 0.0)[:, None]
    np.testing.assert_allclose(kept.actions[:, 2:][deflected], np.clip(expected, -1, 1)[deflected], atol=1e-9)
    assert max(record.age_ns for record in inputs) < DT_NS
    starts = np.array([record.start_ns for record in timings])
    assert np.diff(starts).min() > 0

    def second_day(players):
        game = players.application.game
        assert game.folder.continued
        assert game.folder.counts.kept_in_session.total() == 1
        _join_and_start(players, *gamepads)
        players.carry(*gamepads)
        players.result()
        players.press(gamepads[0], 5)  # undoes the keep of yesterday
        players.until(lambda: game.folder.counts.kept_in_session.total() == 0, "the undo")
        players.press(gamepads[0], A)
        players.phase("Ready")
        players.until(lambda: game.folder.counts.kept_in_session.total() == 1, "the keep")

    # SDL forgets its virtual joysticks when the program closes it.
    gamepads[:] = [VirtualJoystick("Alpha pad", product=1), VirtualJoystick("Beta pad", product=2)]
    with prepared(settings(tmp_path), clock=SimulatedClock(2)) as application:
        summary = _run(application, second_day)
    assert summary["kept_in_session"] == 1
    names = sorted(path.name for path in folder.glob("episode_*"))
    assert names == ["episode_000.mcap", "episode_001.mcap.undone", "episode_002.mcap"]
    lines = [json.loads(line)["event"] for line in (folder / "journal.jsonl").read_text(encoding="utf-8").splitlines()]
    assert lines[0] == "begin"
    assert {"continue", "undo", "redo", "keep", "device_lost", "swap"} <= set(lines)


def test_a_discard_has_its_reason_and_comes_again(tmp_path, gamepads):
    a, b = gamepads

    def play(players):
        game = players.application.game
        _join_and_start(players, a, b)
        players.press(a, 7)  # pause
        players.phase("Paused")
        players.press(a, 4)  # a note, the second of the list
        a.hat(0, -1)
        players.sleep(0.08)
        a.hat(0, 0)
        players.sleep(0.08)
        players.press(a, A)
        assert game.trial.notes == ["hesitated"]
        players.press(b, B)
        players.press(a, 7)
        players.phase("Running")
        players.carry(a, b)
        players.result()
        players.press(a, 3)
        players.press(a, A)
        players.phase("Ready")
        assert game.folder.counts.kept.total() == 0
        assert game.folder.counts.attempted.total() == 1

    with prepared(settings(tmp_path), clock=SimulatedClock(2)) as application:
        _run(application, play)
    (path,) = (tmp_path / "recordings").rglob("*.mcap")
    assert read_episode(path).meta.discarded
    assert read_metadata(path)["episode_result"]["notes"] == "discarded: was not ready; hesitated"


def test_practice_is_recorded_but_never_counts(tmp_path, gamepads):
    def play(players):
        game = players.application.game
        _join_and_start(players, *gamepads)
        assert game.trial.practice
        players.carry(*gamepads)
        players.result()
        players.press(gamepads[0], A)
        players.phase("Ready")
        assert not game.trial.practice

    with prepared(settings(tmp_path, practice=1), clock=SimulatedClock(2)) as application:
        summary = _run(application, play)
    (path,) = (tmp_path / "recordings").rglob("*.mcap")
    meta = read_episode(path).meta
    assert meta.discarded
    assert "practice" in meta.quality_flags.split(",")
    assert summary["kept_in_session"] == 0


def test_headless_joysticks_join_by_order_and_rejoin(tmp_path, gamepads):
    a, b = gamepads
    spare = []

    def play(players):
        game = players.application.game
        players.phase("Running")
        assert [player.label for player in game.players] == ["Alpha pad", "Beta pad"]
        players.carry(a, b, steps=10)
        a.unplug()
        players.phase("Paused")
        spare.append(VirtualJoystick("Alpha pad", product=1))
        players.phase("Running")
        players.carry(b, spare[0])
        players.until(lambda: game.finished, "the end of the session")

    try:
        with prepared(settings(tmp_path, headless=True, episodes=1, window=None)) as application:
            summary = _run(application, play)
    finally:
        for gamepad in spare:
            gamepad.unplug()
    assert summary["complete"] is True
    assert summary["outcomes"] == {"goal": 1}


def test_closing_the_window_keeps_what_was_played(tmp_path, gamepads):
    def play(players):
        _join_and_start(players, *gamepads)
        players.carry(*gamepads, steps=15)
        pygame.event.post(pygame.event.Event(pygame.QUIT))
        players.until(lambda: players.application.game.stop, "the end")

    with prepared(settings(tmp_path)) as application:
        summary = _run(application, play)
    assert summary["ended_by"] == "window closed"
    (path,) = (tmp_path / "recordings").rglob("*.mcap")
    episode = read_episode(path)
    assert len(episode.actions) >= 15
    assert episode.meta.termination_reason == "operator_discard"
    assert episode.meta.discarded
    assert "interrupted" in episode.meta.quality_flags
