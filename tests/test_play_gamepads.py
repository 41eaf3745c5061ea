"""Gamepads at the table: buttons by their meaning, what steers, and the box before the start."""

import pytest
from gamepad_lobby import devices, flags, lobby
from virtual_joystick import PLAYSTATION, VirtualJoystick

from copolicy.collect.inputs import CalibrationStore, MappingStore, StickCalibration
from copolicy.collect.screen import Canvas
from copolicy.collect.screen.dialogs import draw_toast
from copolicy.collect.sdl import pygame
from copolicy.dataset.recording.reader import read_episode

pytestmark = pytest.mark.usefixtures("own_joysticks")


def test_buttons_go_by_their_meaning_and_by_what_is_printed_on_them(tmp_path):
    sony = VirtualJoystick("Wireless Controller", 0x054C, 0x09CC, axes=6, buttons=13, mapping=PLAYSTATION)
    other = VirtualJoystick("Beta pad", product=2)
    with lobby(tmp_path) as hands:
        hands.press(7, sony)  # a trigger; any button joins
        hands.press(0, other)
        assert devices(hands) == ["Wireless Controller", "Beta pad"]
        assert [hands.panel(k).prompt for k in (0, 1)] == ["Cross: choose   Circle: next", "A: choose   B: next"]
        hands.press(1, sony)
        hands.press(0, other)
        hands.ticks(20)
        hands.press(1, sony)  # starts
        hands.ticks(3)
        assert hands.phase == "Running"
        for trigger in (6, 7):
            hands.press(trigger, sony)
            assert hands.phase == "Running"
        hands.press(9, sony)
        assert hands.phase == "Paused"
        hints = hands.game.roster.hint(("a", "K", "keep"), ("x", "R", "redo"), ("y", "X", "discard"))
        assert hints == "Cross keep   Square redo   Triangle discard     |     A keep   X redo   Y discard"
        assert [labels.either("start", "back") for labels in hands.game.roster.labels()] == [
            "Options or Share",
            "Menu or View",
        ]


def test_a_gamepad_that_nobody_knows_is_set_up_in_the_lobby_and_kept(tmp_path):
    strange = VirtualJoystick("Strange pad", product=3, axes=4, buttons=12, hats=0, mapping=None)
    config = tmp_path / "config"
    with lobby(tmp_path) as hands:
        hands.press(5, strange)  # joins with any button
        assert hands.panel().prompt == "button 0: choose   button 1: next"
        assert hands.panel().notice == "the buttons of this gamepad are unknown: set them up"
        for _ in range(5):
            hands.press(1, strange)
        assert hands.panel().items[hands.panel().cursor] == "set up the buttons"
        hands.press(0, strange)
        assert hands.panel().prompt == "press the button for: choose and start"
        for button in (2, 3, 11, 2, 2, 4, 2):  # no button for redo, discard and undo
            hands.press(button, strange)
        assert hands.panel().prompt == "push the stick or d-pad that steers to the right"
        strange.axis(3, -0.9)
        hands.ticks(2)
        assert hands.panel().prompt == "now push it down, towards you"
        strange.axis(2, 0.9)
        hands.ticks(2)
        strange.axis(3, 0.0)
        strange.axis(2, 0.0)
        hands.ticks(2)
        panel = hands.panel()
        assert (panel.prompt, panel.notice) == ("button 2: choose   button 3: next", "")
        strange.axis(3, -1.0)
        hands.ticks(1)
        assert hands.panel().force == pytest.approx((1.0, 0.0), abs=1e-3)
        strange.axis(3, 0.0)
        hands.press(2, strange)  # the menu again, where the cursor was
        assert hands.panel().progress is not None
        hands.press(0, strange)
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_ESCAPE))
        hands.ticks(1)
        assert hands.panel().progress is None
    mapping = MappingStore(config).get(strange.guid)
    assert mapping is not None
    assert mapping.control_of_button(11) == "start"
    assert mapping.control_of_button(7) is None
    assert mapping.stick("left") == ((3, 2), (True, False))
    assert CalibrationStore(config).get(strange.guid) == StickCalibration(axes=(3, 2), invert=(True, False))

    again = VirtualJoystick("Strange pad", product=3, axes=4, buttons=12, hats=0, mapping=None)
    with lobby(tmp_path) as hands:
        hands.press(2, again)
        assert hands.panel().prompt == "button 2: choose   button 3: next"


def test_a_mapping_that_cannot_be_kept_holds_and_is_said(tmp_path):
    strange = VirtualJoystick("Strange pad", product=3, axes=2, buttons=12, hats=0, mapping=None)
    config = tmp_path / "config"
    with lobby(tmp_path) as hands:
        config.write_text("in the way", encoding="utf-8")
        hands.press(0, strange)
        for _ in range(5):
            hands.press(1, strange)
        for button in (0, 4, 5, 6, 7, 8, 9, 10):
            hands.press(button, strange)
        for axis in (0, 1):
            strange.axis(axis, 1.0)
            hands.ticks(2)
        assert "not saved" in hands.game.toast
        assert hands.panel().prompt == "button 4: choose   button 5: next"


def test_a_gamepad_with_nothing_but_a_hat_steers_by_it(tmp_path):
    plain = VirtualJoystick("Plain", product=4, axes=0, hats=1, mapping=None)
    other = VirtualJoystick("Beta pad", product=2)
    with lobby(tmp_path) as hands:
        hands.press(0, plain)
        assert hands.panel().steering == "d-pad"
        plain.hat(1, -1)
        hands.ticks(1)
        assert hands.panel().force == pytest.approx((0.5**0.5, 0.5**0.5))
        assert hands.panel().notice.startswith("the buttons of this gamepad")
        plain.hat(0, 0)
        hands.press(0, other)
        hands.start(plain, other)
        plain.hat(1, 0)
        hands.ticks(12)
    (path,) = tmp_path.rglob("*.mcap")
    episode = read_episode(path)
    assert (episode.actions[-8:, :2] == (1.0, 0.0)).all()
    assert flags(path) == set()


def test_a_device_that_cannot_steer_does_not_join_and_is_told_so(tmp_path):
    buttons = VirtualJoystick("Buttons", product=5, axes=1, hats=0, mapping=None)
    with lobby(tmp_path) as hands:
        hands.press(0, buttons)
        assert devices(hands) == [None, None]
        assert hands.panel().notice == "Buttons has neither a stick nor a d-pad: it cannot steer"


def test_without_pilots_named_only_what_can_steer_counts(tmp_path):
    VirtualJoystick("Buttons", product=5, axes=1, hats=0, mapping=None)
    with lobby(tmp_path, players=None) as hands:
        assert [player.spec.kind for player in hands.game.players] == ["keyboard", "keyboard"]


def test_the_axes_that_steer_can_be_chosen_and_are_kept(tmp_path):
    gamepad = VirtualJoystick("Alpha pad", product=1)
    config = tmp_path / "config"
    with lobby(tmp_path) as hands:
        hands.press(0, gamepad)
        assert hands.panel().steering == "left stick"
        for _ in range(4):
            hands.press(1, gamepad)
        hands.press(0, gamepad)
        assert hands.panel().items[0] == "steer with: left stick"
        gamepad.hat(1, 0)
        hands.ticks(1)
        gamepad.hat(0, 0)
        hands.ticks(1)
        seen = [hands.panel().steering]
        for _ in range(2):
            hands.press(0, gamepad)
            seen.append(hands.panel().steering)
        assert seen == ["d-pad", "left stick", "d-pad"]
        hands.press(1, gamepad)
        hands.press(0, gamepad)
        assert hands.panel().items[1] == "left-right inverted: yes"
        gamepad.hat(1, 0)
        hands.ticks(1)
        assert hands.panel().force == (-1.0, 0.0)
        gamepad.hat(0, 0)
        for _ in range(2):
            hands.press(1, gamepad)
        hands.press(0, gamepad)
        assert hands.panel().items[4] == "steering: d-pad"
    assert CalibrationStore(config).get(gamepad.guid).axes == (4, 5)


def test_the_box_before_the_start_hides_nothing_of_the_world(tmp_path):
    gamepads = [VirtualJoystick("Alpha pad", product=1), VirtualJoystick("Beta pad", product=2)]
    with lobby(tmp_path, countdown_s=30.0) as hands:
        for gamepad in gamepads:
            hands.press(0, gamepad)
        for gamepad in gamepads:
            hands.press(0, gamepad)
        hands.ticks(20)
        world = (0, 60, 1200, 600)
        bare = Canvas(pygame.Surface((1200, 760), depth=32))
        bare.clear()
        hands.application.phase.draw_world(bare, hands.game.trial)
        expected = pygame.image.tobytes(bare.surface.subsurface(world), "RGB")
        for phase in ("Ready", "Countdown"):
            assert hands.phase == phase
            shown = hands.screen()
            draw_toast(Canvas(shown), "a message")
            assert pygame.image.tobytes(shown.subsurface(world), "RGB") == expected
            hands.press(0, gamepads[0])
