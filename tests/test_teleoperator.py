"""The pair as a LeRobot teleoperator, with virtual joysticks."""

import math
import threading
import time

import pytest
from lerobot.teleoperators import make_teleoperator_from_config
from lerobot.teleoperators.config import TeleoperatorConfig
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError
from virtual_joystick import VirtualJoystick

import lerobot_policy_copolicy  # noqa: F401  registers the teleoperator
from copolicy.collect.inputs import CalibrationStore, StickCalibration
from copolicy.collect.sdl import pygame
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.tasks.table.features import ACTION_NAMES

pytestmark = pytest.mark.usefixtures("own_joysticks")


@pytest.fixture
def sticks():
    """Two pads of one make: nothing but a press tells them apart."""
    plugged = [VirtualJoystick("Pad"), VirtualJoystick("Pad")]
    yield plugged
    for stick in plugged:
        stick.unplug()


@pytest.fixture
def teleoperator(tmp_path):
    made = []

    def make(**options):
        config = TeleoperatorConfig.get_choice_class("copolicy_pair")
        made.append(make_teleoperator_from_config(config(calibration_dir=tmp_path, **options)))
        return made[-1]

    yield make
    for one in made:
        one.disconnect()


def test_lerobot_makes_it_from_the_flag_of_its_commands(teleoperator):
    pair = teleoperator()
    assert type(pair).__name__ == "CopolicyPair"
    assert pair.config.type == pair.name == "copolicy_pair"
    assert pair.action_features == dict.fromkeys(ACTION_NAMES, float)
    assert pair.feedback_features == {}
    assert not pair.is_connected
    with pytest.raises(DeviceNotConnectedError):
        pair.get_action()


def test_forces_come_from_the_pads_in_the_order_of_their_numbers(teleoperator, sticks):
    pair = teleoperator(join=False, robot_pad=1, human_pad=0)
    pair.connect(calibrate=False)
    assert pair.is_connected
    assert pair.get_action() == dict.fromkeys(ACTION_NAMES, 0.0)
    sticks[0].move(0.0, -1.0)
    sticks[1].move(1.0, 0.05)
    action = pair.get_action()
    assert {name: round(value, 2) for name, value in action.items()} == {
        "robot_fx": 1.0, "robot_fy": 0.05, "human_fx": 0.0, "human_fy": -1.0,
    }  # fmt: skip
    assert all(type(value) is float for value in action.values())
    sticks[0].move(0.05, 0.05)  # within the dead zone
    assert pair.get_action()["human_fx"] == 0.0
    with pytest.raises(DeviceAlreadyConnectedError):
        pair.connect()


def press(stick, after_s):
    time.sleep(after_s)
    while not stick.is_open:
        time.sleep(0.01)
    stick.button(0, True)
    time.sleep(0.2)
    stick.button(0, False)


def test_a_press_binds_a_pad_to_a_seat(teleoperator, sticks):
    pair = teleoperator(timeout_s=10.0)
    players = [threading.Thread(target=press, args=job) for job in ((sticks[1], 0.1), (sticks[0], 0.5))]
    for player in players:
        player.start()
    pair.connect(calibrate=False)
    for player in players:
        player.join()
    sticks[1].move(0.0, 1.0)
    assert pair.get_action()["robot_fy"] == pytest.approx(1.0, abs=1e-4)


@pytest.fixture
def listed_twice(sticks):
    """Both sticks say what one player does, as one pad that the system lists twice."""

    class Copies:
        def act(self, press=False, x=0.0):
            for stick in sticks:
                while not stick.is_open:
                    time.sleep(0.01)
                stick.button(0, press)
                stick.move(x, 0.0)

    return Copies()


def test_a_pad_that_is_listed_twice_does_not_get_both_seats(teleoperator, listed_twice):
    pair = teleoperator(timeout_s=0.8)

    def presses():
        for _ in range(8):
            listed_twice.act(press=True)
            time.sleep(0.1)
            listed_twice.act()
            time.sleep(0.1)

    player = threading.Thread(target=presses)
    player.start()
    with pytest.raises(DeviceNotConnectedError, match="found none on another gamepad: Pad was pressed together"):
        pair.connect(calibrate=False)
    player.join()
    assert not pair.is_connected


def test_two_pads_that_never_differ_are_refused(teleoperator, listed_twice):
    pair = teleoperator(join=False)
    pair.connect(calibrate=False)
    assert pair.get_action() == dict.fromkeys(ACTION_NAMES, 0.0)
    for step in range(1, 10):
        listed_twice.act(x=0.04 * step)
        pair.get_action()
    listed_twice.act(x=0.5)
    with pytest.raises(DeviceNotConnectedError, match=r"found one that is listed twice \(Pad and Pad\)"):
        pair.get_action()
    pair.disconnect()


def test_two_people_who_do_much_the_same_are_two(teleoperator, sticks):
    pair = teleoperator(join=False)
    pair.connect(calibrate=False)
    for step in range(1, 20):
        sticks[0].move(0.04 * step, 0.0)
        sticks[1].move(0.04 * step + 0.01, 0.0)
        assert pair.get_action()["human_fx"] >= pair.get_action()["robot_fx"]


def test_what_steers_and_rests_is_looked_at(teleoperator, caplog):
    plain = VirtualJoystick("Plain", product=7, axes=0, mapping=None)
    resting = VirtualJoystick("Loose", product=8)
    pair = teleoperator(join=False)
    pair.connect(calibrate=False)
    plain.hat(1, 1)
    resting.move(0.25, 0.0)
    action = pair.get_action()
    assert (action["robot_fx"], action["robot_fy"]) == pytest.approx((0.5**0.5, -(0.5**0.5)))
    pair.disconnect()
    pair.connect(calibrate=False)
    assert "human seat: Loose pushes with 0.15 and was never calibrated" in caplog.messages
    pair.disconnect()
    plain.unplug()
    buttons = VirtualJoystick("Buttons", product=9, axes=1, hats=0, mapping=None)
    with pytest.raises(
        DeviceNotConnectedError, match="expected a stick or a d-pad to steer with, found none on Buttons"
    ):
        pair.connect(calibrate=False)
    buttons.unplug()
    resting.unplug()


def test_nobody_presses(teleoperator, sticks):
    pair = teleoperator(timeout_s=0.1)
    with pytest.raises(
        DeviceNotConnectedError, match=r"expected a press of a button for the robot seat within 0\.1 s, found none"
    ):
        pair.connect()
    assert not pair.is_connected


def test_too_few_pads(teleoperator):
    stick = VirtualJoystick()
    with pytest.raises(DeviceNotConnectedError, match="copolicy_pair: expected two gamepads, found 1 plugged in"):
        teleoperator().connect()
    second = VirtualJoystick()
    with pytest.raises(DeviceNotConnectedError, match="copolicy_pair: expected a gamepad number 5, found 2 plugged in"):
        teleoperator(join=False, human_pad=5).connect()
    stick.unplug()
    second.unplug()


def test_an_unplugged_pad_is_an_error_and_not_a_zero_force(teleoperator, sticks):
    pair = teleoperator(join=False)
    pair.connect(calibrate=False)
    sticks[1].unplug()
    with pytest.raises(
        DeviceNotConnectedError, match=r"copolicy_pair: the gamepad of the human seat \(Pad\) was unplugged"
    ):
        pair.get_action()
    assert not pair.is_connected
    with pytest.raises(DeviceNotConnectedError, match="is not connected"):
        pair.get_action()
    again = VirtualJoystick("Pad")
    pair.connect(calibrate=False)
    again.move(-1.0, 0.0)
    assert pair.get_action()["human_fx"] == pytest.approx(-1.0, abs=1e-4)
    again.unplug()


def test_a_pad_that_nobody_holds_may_be_unplugged(teleoperator, sticks):
    third = VirtualJoystick("Spare")
    pair = teleoperator(join=False)
    pair.connect(calibrate=False)
    third.unplug()
    assert pair.get_action() == dict.fromkeys(ACTION_NAMES, 0.0)


def test_calibrations_are_those_of_the_collection_tool(teleoperator, sticks, tmp_path):
    pair = teleoperator(join=False)
    pair.connect(calibrate=False)
    assert not pair.is_calibrated
    guid = next(iter(pair._pads)).guid
    CalibrationStore(tmp_path).put(guid, StickCalibration(high=(0.5, 0.5), invert=(True, False)))
    pair = teleoperator(join=False)
    pair.connect()
    assert pair.is_calibrated
    sticks[0].move(0.5, 0.0)
    assert pair.get_action()["robot_fx"] == pytest.approx(-1.0, abs=1e-4)


def turn_round(stick, stop):
    """Rests for a good second, then turns round an edge at 0.8."""
    while not stick.is_open:
        time.sleep(0.01)
    time.sleep(1.3)
    angle = 0.0
    while not stop.is_set():
        stick.move(0.8 * math.cos(angle), 0.8 * math.sin(angle))
        angle += 0.2
        time.sleep(0.02)
    stick.move(0.0, 0.0)


def test_connecting_calibrates_a_make_once(teleoperator, sticks, tmp_path):
    pair = teleoperator(join=False, timeout_s=20.0)
    stop = threading.Event()
    player = threading.Thread(target=turn_round, args=(sticks[0], stop))
    player.start()
    pair.connect()
    stop.set()
    player.join()
    assert pair.is_calibrated
    (calibration,) = CalibrationStore(tmp_path)._by_guid.values()
    assert calibration.high[0] == pytest.approx(0.8, abs=0.05)
    sticks[0].move(0.8, 0.0)
    assert pair.get_action()["robot_fx"] == pytest.approx(1.0, abs=0.07)


def test_a_stick_that_is_not_turned_keeps_the_usual_values(teleoperator, sticks, caplog):
    pair = teleoperator(join=False, timeout_s=0.2)
    pair.connect()
    assert "human seat: not turned round in time, the default range is used" in caplog.messages
    assert not pair.is_calibrated
    assert pair.is_connected


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"robot_pad": 1}, "robot_pad, human_pad: expected two different gamepads, from 0, found (1, 1)"),
        ({"timeout_s": 0.0}, "timeout_s: expected a positive number, found 0.0"),
    ],
)
def test_settings_that_cannot_be(teleoperator, options, text):
    from lerobot_policy_copolicy.teleoperator.copolicy_pair import CopolicyPair

    config = TeleoperatorConfig.get_choice_class("copolicy_pair")
    with pytest.raises(InvalidValueError) as caught:
        CopolicyPair(config(**options))
    assert str(caught.value) == text


def test_the_windows_events_stay_and_disconnecting_leaves_pygame_alone(teleoperator, sticks):
    pair = teleoperator(join=False)
    pair.connect(calibrate=False)
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_a))
    sticks[0].move(1.0, 0.0)
    pair.get_action()
    assert pygame.KEYDOWN in [event.type for event in pygame.event.get()]
    pair.disconnect()
    assert not pair.is_connected
    assert pygame.display.get_init()
    assert pygame.joystick.get_init()
    pair.disconnect()
