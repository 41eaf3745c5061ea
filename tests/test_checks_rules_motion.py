"""The rules of time, numbers and motion on data with one thing wrong."""

import numpy as np
import pytest
from changed_tables import all_frames, find, of, with_column, with_entry, with_frames

from copolicy.dataset.features import ACTION, STATE


@pytest.mark.parametrize(("share", "severity"), [(0.005, None), (0.05, "warning"), (0.5, "error")])
def test_late_ticks(sound, share, severity):
    late = int(share * 30 * sound.columns["duration_s"][3])
    found = find(with_entry(sound, "late_ticks", 3, late), "late_ticks")
    assert of(found) == ([] if severity is None else [("3", severity)])


@pytest.mark.parametrize(("rate", "severity"), [(29.9, None), (29.0, "warning"), (20.0, "error")])
def test_achieved_rate(sound, rate, severity):
    found = find(with_entry(sound, "achieved_hz", 0, rate), "achieved_hz")
    assert of(found) == ([] if severity is None else [("0", severity)])


def test_people_whose_rate_is_unknown(sound):
    people = with_column(sound, "source", ["human"] * 6)
    assert [(f.figure, f.severity) for f in find(people, "achieved_hz")] == [(6, "warning")]


def test_gaps_in_time(sound):
    later = with_frames(sound, "timestamp", lambda time: time.__setitem__(slice(sound.starts[4] + 9, sound.ends[4]), 7))
    assert of(find(later, "timestamps")) == [("4", "error")]
    longer = with_entry(sound, "duration_s", 5, float(sound.columns["duration_s"][5] + 0.5))
    assert of(find(longer, "duration")) == [("5", "error")]

    def cut(states):
        states[sound.starts[1] + 20 : sound.ends[1] + 1, 0] += 12.0

    found = find(with_frames(sound, STATE, cut), "jumps")
    assert of(found) == [("1", "error")]
    assert 60 < float(str(found[0].figure)) < 180  # 12 px in a tenth of a second, and the table's own motion


@pytest.mark.parametrize(("drift", "severity"), [(0.5, None), (3.0, "warning"), (50.0, "error"), (np.nan, "info")])
def test_drift(sound, drift, severity):
    found = find(with_entry(sound, "replay_drift_px", 2, drift), "drift")
    expected = [] if severity is None else [("" if severity == "info" else "2", severity)]
    assert of(found) == expected


def test_numbers_out_of_range(sound):
    def overdrive(actions):
        actions[sound.starts[0] + 3, 1] = -1.2

    found = find(with_frames(sound, ACTION, overdrive), "action_range")
    assert [(f.episode, round(float(str(f.figure)), 3)) for f in found] == [("0", 1.2)]

    def broken(states):
        states[sound.starts[1], 4] = np.nan
        states[sound.starts[2], 0] = 1250.0
        states[sound.starts[3], 2] *= 0.9

    table = with_frames(sound, STATE, broken)
    assert of(find(table, "finite")) == [("1", "error")]
    assert of(find(table, "state_range")) == [("2", "error"), ("3", "error")]


def test_idle_players(sound):
    def rest(actions):
        actions[all_frames(sound, 1), 2:] = 0.01
        actions[sound.starts[2] + 1 : sound.starts[2] + 56, :2] = 0.0

    table = with_frames(sound, ACTION, rest)
    found = find(table, "idle")
    assert ("1", "warning") in of(found)
    assert ("2", "idle_run", 5.5) in [(f.episode, f.rule, f.figure) for f in found if f.rule == "idle_run"]
    people = find(with_column(table, "source", ["human"] * 6), "idle")
    assert ("1", "error") in of(people)


def _copied(table, episode, jitter=0.0):
    def copy(actions):
        rows = all_frames(table, episode)
        actions[rows, 2:] = actions[rows, :2] + jitter

    return with_frames(table, ACTION, copy)


@pytest.mark.parametrize(
    ("source", "controller", "severity"),
    [("human", "joystick", "error"), ("human", "keyboard", "warning"), ("simulated", "scripted", "info")],
)
def test_one_device_that_moved_both_players(sound, source, controller, severity):
    table = with_column(_copied(sound, 2), "source", [source] * 6)
    table = with_column(with_column(table, "controller_0", [controller] * 6), "controller_1", [controller] * 6)
    assert of(find(table, "identical")) == [("2", severity)]
    assert of(find(_copied(table, 4, jitter=0.005), "identical")) == [("2", severity), ("4", severity)]
    assert of(find(_copied(table, 4, jitter=0.05), "identical")) == [("2", severity)]


def test_two_idle_players_are_no_copies_of_each_other(sound):
    def rest(actions):
        actions[all_frames(sound, 1)] = 0.0
        actions[all_frames(sound, 3)] = 0.0
        # One frame is pushed by both alike, another by one of them.
        actions[sound.starts[3] + 4] = 0.5
        actions[sound.starts[3] + 7, 0] = 0.5

    assert find(with_frames(sound, ACTION, rest), "identical") == []


def test_saturated_sticks_and_keys(sound):
    def full(actions):
        actions[all_frames(sound, 3), :2] = 1.0

    table = with_frames(sound, ACTION, full)
    assert of(find(table, "saturated")) == [("3", "warning")]
    assert of(find(with_column(table, "controller_0", ["keyboard: wasd"] * 6), "saturated")) == [("3", "info")]


def test_short_and_stuck_episodes(sound):
    assert of(find(with_entry(sound, "length", 4, 9), "short")) == [("4", "warning")]

    def rest(states):
        states[sound.starts[5] + 1 : sound.starts[5] + 56, 4:6] = 0.5
        states[all_frames(sound, 0), :2] = states[sound.starts[0], :2]

    found = find(with_frames(sound, STATE, rest), "stuck")
    assert [(f.episode, f.rule) for f in found if f.rule == "unmoved"] == [("0", "unmoved")]
    assert ("5", "stuck") in [(f.episode, f.rule) for f in found]
