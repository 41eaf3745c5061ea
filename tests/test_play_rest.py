"""Sticks that push at rest: shown in the lobby, flagged in the recording."""

import json

import pytest
from gamepad_lobby import flags, lobby
from virtual_joystick import VirtualJoystick

from copolicy.collect.inputs import CalibrationStore, StickCalibration
from copolicy.dataset.recording.reader import read_metadata

pytestmark = pytest.mark.usefixtures("own_joysticks")


def test_a_stick_that_pushes_at_rest_is_shown_and_the_episode_flagged(tmp_path):
    loose, sound = VirtualJoystick("Loose", product=6), VirtualJoystick("Sound", product=2)
    with lobby(tmp_path) as hands:
        loose.move(0.25, 0.0)
        hands.press(0, loose)
        hands.press(0, sound)
        hands.ticks(20)
        assert hands.panel(0).notice == "pushes with 0.15 at rest: calibrate the stick"
        assert hands.panel(1).notice == ""
        hands.start(loose, sound)
        for step in range(10):
            loose.move(0.1 * step, 0.0)
            hands.ticks()
    (path,) = tmp_path.rglob("*.mcap")
    assert flags(path) == {"stick_off_centre"}
    devices_record = read_metadata(path)["devices"]
    about = [devices_record[f"seat_0_{name}"] for name in ("measured", "steering", "mapping")]
    assert about == ["False", "left stick", "sdl"]


def test_an_uncalibrated_stick_that_rests_off_centre_in_an_episode_is_flagged(tmp_path):
    gamepads = [VirtualJoystick("Loose", product=6), VirtualJoystick("Sound", product=2)]
    with lobby(tmp_path, headless=True, window=None) as hands:
        hands.ticks(3)
        gamepads[0].move(0.0, 0.25)
        hands.ticks(35)
    (path,) = tmp_path.rglob("*.mcap")
    assert flags(path) == {"stick_off_centre"}


@pytest.mark.parametrize("rest", [(0.25, 0.0), (0.0, -1.0)])
def test_a_calibrated_stick_and_one_that_is_let_go_are_not_flagged(tmp_path, rest):
    held, other = VirtualJoystick("Held", product=6), VirtualJoystick("Sound", product=2)
    calibration = StickCalibration(centre=(0.25, 0.0), low=(-0.8, -0.9), high=(0.9, 0.9))
    CalibrationStore(tmp_path / "config").put(held.guid, calibration)
    with lobby(tmp_path) as hands:
        held.move(0.25, 0.0)
        hands.press(0, held)
        hands.press(0, other)
        hands.ticks(20)
        held.move(*rest)  # held at its stop, or at rest
        hands.ticks(20)
        assert hands.panel(0).notice == ""
        held.move(0.25, 0.0)
        hands.start(held, other)
        hands.ticks(40)
    (path,) = tmp_path.rglob("*.mcap")
    assert flags(path) == set()


def test_a_calibration_that_no_longer_holds_is_noticed_after_two_seconds(tmp_path):
    gamepad = VirtualJoystick("Worn", product=6)
    CalibrationStore(tmp_path / "config").put(gamepad.guid, StickCalibration(low=(-0.9, -0.9), high=(0.9, 0.9)))
    with lobby(tmp_path) as hands:
        gamepad.move(0.0, -0.25)
        hands.press(0, gamepad)
        hands.ticks(20)
        assert hands.panel().notice == ""
        hands.ticks(45)
        assert hands.panel().notice == "pushes with 0.18 at rest: calibrate the stick"
        gamepad.move(0.0, 0.0)
        hands.ticks(61)
        assert hands.panel().notice == ""


def test_a_changed_dead_zone_is_no_calibration(tmp_path):
    gamepad = VirtualJoystick("Loose", product=6)
    config = tmp_path / "config"
    with lobby(tmp_path) as hands:
        hands.press(0, gamepad)
        for _ in range(3):
            hands.press(1, gamepad)
        hands.press(0, gamepad)
        assert hands.panel().items[3] == "dead zone  0.13"
    assert gamepad.guid not in CalibrationStore(config)
    # Files did not say before whether a centre was measured.
    entries = json.loads((config / "calibrations.json").read_text(encoding="utf-8"))
    assert entries[gamepad.guid].pop("measured") is False
    (config / "calibrations.json").write_text(json.dumps(entries), encoding="utf-8")
    assert gamepad.guid not in CalibrationStore(config)
