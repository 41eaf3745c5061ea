"""`copolicy-collect devices`: the list of gamepads, and their live input."""

import io
import json
import threading
import time

import pytest
from virtual_joystick import VirtualJoystick

from copolicy.collect.cli import main
from copolicy.collect.devices import list_devices, open_gamepads, poll_gamepads, show_input, table_lines
from copolicy.collect.inputs import CalibrationStore, StickCalibration
from copolicy.collect.sdl import pygame
from copolicy.dataset.exceptions import InvalidValueError, RunError

pytestmark = pytest.mark.usefixtures("own_joysticks")


@pytest.fixture
def sticks():
    plugged = [VirtualJoystick("Left pad", product=1), VirtualJoystick("Right pad", product=2, axes=2, buttons=4)]
    yield plugged
    for stick in plugged:
        stick.unplug()


def test_every_gamepad_is_listed(tmp_path, sticks):
    calibrations = CalibrationStore(tmp_path)
    left, right = list_devices(open_gamepads(), calibrations)
    assert left | {"guid": ""} == {
        "instance": sticks[0].instance_id, "name": "Left pad", "guid": "", "axes": 4, "buttons": 10, "hats": 1,
        "calibrated": False,
    }  # fmt: skip
    assert (right["name"], right["axes"], right["buttons"]) == ("Right pad", 2, 4)
    assert left["guid"] != right["guid"]
    assert len(left["guid"]) == 32
    calibrations.put(right["guid"], StickCalibration())
    assert [device["calibrated"] for device in list_devices(open_gamepads(), calibrations)] == [False, True]


def test_gamepads_are_found_after_their_events_were_read(sticks):
    pygame.event.get()
    assert len(open_gamepads()) == 2


def test_events_of_a_window_stay_in_the_queue(sticks):
    pads = open_gamepads()
    key = pygame.event.Event(pygame.KEYDOWN, key=pygame.K_a)
    pygame.event.post(key)
    sticks[0].move(1.0, 0.0)
    sticks[1].unplug()
    assert [pad.name for pad in poll_gamepads(pads)] == ["Right pad"]
    kinds = [event.type for event in pygame.event.get()]
    assert pygame.KEYDOWN in kinds
    assert not {pygame.JOYAXISMOTION, pygame.JOYDEVICEREMOVED} & set(kinds)


def test_the_table_aligns(sticks, tmp_path):
    lines = table_lines(list_devices(open_gamepads(), CalibrationStore(tmp_path)))
    assert lines[0].split() == ["instance", "name", "guid", "axes", "buttons", "hats", "calibrated"]
    assert len({line.index(word) for line, word in zip(lines, ("guid", "ff", "ff"), strict=True)}) == 1
    assert [line.split()[-1] for line in lines[1:]] == ["no", "no"]
    assert table_lines([]) == ["no gamepad is connected"]


class Terminal(io.StringIO):
    def isatty(self):
        return True


def move_sticks(sticks):
    """Deflects, presses and unplugs."""
    while not sticks[0].is_open:
        time.sleep(0.01)
    sticks[0].move(-1.0, 0.5)
    sticks[0].button(3, True)
    time.sleep(0.3)
    sticks[0].move(0.0, 0.0)
    sticks[0].button(3, False)
    sticks[1].unplug()


@pytest.mark.parametrize("kind", [Terminal, io.StringIO])
def test_the_live_test_shows_the_input_and_returns_its_range(tmp_path, sticks, kind):
    out = kind()
    player = threading.Thread(target=move_sticks, args=(sticks,))
    pads = open_gamepads()
    player.start()
    summaries = show_input(pads, CalibrationStore(tmp_path), 0.8, out)
    player.join()
    left, right = summaries[sticks[0].instance_id], summaries[sticks[1].instance_id]
    assert left["axes"][:2] == [[-1.0, 0.0], [0.0, 0.5]]
    assert (left["buttons"], left["unplugged"]) == ([3], False)
    assert (right["buttons"], right["unplugged"]) == ([], True)
    assert 0 < right["readings"] < left["readings"]
    text = out.getvalue()
    if kind is Terminal:
        assert "force -1.00 +0.51" in text
        assert "[###########          ] -1.00" in text
        assert "buttons  3" in text
        assert "\x1b[" in text
    else:
        assert "\x1b[" not in text
        assert text.count("Left pad") == 1


def test_errors_of_the_live_test(tmp_path, sticks):
    calibrations = CalibrationStore(tmp_path)
    with pytest.raises(InvalidValueError, match="seconds: expected a positive number, found 0"):
        show_input(open_gamepads(), calibrations, 0, io.StringIO())
    for stick in sticks:
        stick.unplug()
    with pytest.raises(RunError, match="expected at least one gamepad, found none connected"):
        show_input(open_gamepads(), calibrations, 1.0, io.StringIO())


def test_the_command(tmp_path, sticks, capsys):
    assert main(["devices", "--config-dir", str(tmp_path)]) == 0
    assert "Right pad" in capsys.readouterr().out.splitlines()[2]
    assert main(["devices", "--json", "--test", "0.2", "--config-dir", str(tmp_path)]) == 0
    captured = capsys.readouterr()
    summary = json.loads(captured.out)
    assert [device["name"] for device in summary["devices"]] == ["Left pad", "Right pad"]
    assert summary["test"][str(sticks[0].instance_id)]["axes"] == [[0.0, 0.0]] * 4
    assert "axis 0" in captured.err


def test_a_list_without_gamepads_is_not_an_error(tmp_path, capsys):
    assert main(["devices", "--config-dir", str(tmp_path)]) == 0
    assert capsys.readouterr().out == "no gamepad is connected\n"
    assert main(["devices", "--test", "1", "--config-dir", str(tmp_path)]) == 1
    assert capsys.readouterr().err == "copolicy-collect: expected at least one gamepad, found none connected\n"
