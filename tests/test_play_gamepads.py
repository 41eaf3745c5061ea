"""Gamepads at the table: one that is listed twice, other numberings, d-pads, sticks off their centre."""

import json
from contextlib import contextmanager

import pytest
from play_session import on_short_map, settings
from virtual_joystick import PLAYSTATION, VirtualJoystick

from copolicy.collect.inputs import CalibrationStore, MappingStore, StickCalibration
from copolicy.collect.play.session_run import prepared
from copolicy.collect.screen import Canvas
from copolicy.collect.screen.dialogs import draw_toast
from copolicy.collect.sdl import pygame
from copolicy.dataset.cli import main as check
from copolicy.dataset.log import read_episode, read_metadata


@pytest.fixture(autouse=True)
def _own_joysticks():
    pygame.joystick.quit()
    pygame.display.quit()
    pygame.display.init()
    pygame.joystick.init()
    yield
    pygame.joystick.quit()
    pygame.display.quit()


class Hands:
    """Presses and ticks by turns, without waiting for the clock."""

    def __init__(self, application):
        self.application = application
        self.game = application.game

    @property
    def phase(self):
        return type(self.application.phase).__name__

    def ticks(self, count=1):
        for _ in range(count):
            assert self.application._tick(self.game.ticker.tick())

    def press(self, button, *pads):
        """Several pads at the same moment are one that is listed twice, or two people."""
        for down in (True, False):
            for pad in pads:
                pad.button(button, down)
            self.ticks(4)

    def panel(self, player=0):
        players = self.game.seats()
        seat = [one.index for one in players].index(player)
        return self.application.phase._panel(seat, players[seat])

    def screen(self):
        canvas = Canvas(pygame.Surface((1200, 760), depth=32))
        canvas.clear()
        self.application.phase.draw(canvas, 1.0)
        return canvas.surface

    def start(self, *pads, button=0):
        """From the lobby, where all have joined, to the first step."""
        for pad in pads:
            self.press(button, pad)
        self.ticks(20)
        assert self.phase == "Ready"
        self.press(button, pads[0])
        self.ticks(3)
        assert self.phase == "Running"


@contextmanager
def lobby(tmp_path, **changes):
    with prepared(settings(tmp_path, **changes)) as application:
        on_short_map(application)
        application.phase.enter()
        yield Hands(application)
        application.game.break_off("quit")


def flags(path):
    """Of a recording; how fast the test ticks is not looked at."""
    return set(read_episode(path).meta.quality_flags.split(",")) - {"interrupted", "slow_loop", ""}


def devices(hands):
    return [player.device.name if player.device else None for player in hands.game.players]


# One pad, listed twice


def test_one_press_on_a_pad_that_is_listed_twice_seats_one_player(tmp_path):
    copies = [VirtualJoystick("Pad"), VirtualJoystick("Pad")]
    with lobby(tmp_path) as hands:
        for _ in range(4):
            hands.press(0, *copies)
        assert devices(hands) == ["Pad", None]
        assert [player.ready for player in hands.game.players] == [True, False]
        hands.ticks(40)
        assert hands.phase == "Lobby"
        assert hands.panel(1).notice == (
            "Pad and the other gamepad were pressed at once: press one alone, it may be listed twice"
        )
        # The other player has a pad of their own.
        third = VirtualJoystick("Other pad", product=2)
        hands.ticks(2)
        hands.press(0, third)
        assert devices(hands) == ["Pad", "Other pad"]
        journal = (hands.game.folder.path / "journal.jsonl").read_text(encoding="utf-8")
        assert '"refused"' in journal


def test_a_copy_that_comes_a_tick_later_is_no_second_player_either(tmp_path):
    first, copy = VirtualJoystick("Pad"), VirtualJoystick("Pad")
    with lobby(tmp_path) as hands:
        for down in (True, False):
            first.button(0, down)
            hands.ticks()
            copy.button(0, down)
            hands.ticks(5)
        assert devices(hands) == ["Pad", None]


def test_two_people_with_pads_of_one_make_join_and_may_press_at_the_same_moment(tmp_path):
    a, b = VirtualJoystick("Pad"), VirtualJoystick("Pad")
    with lobby(tmp_path) as hands:
        hands.press(0, a, b)
        assert devices(hands) == ["Pad", None]
        (seated,) = (player.device.instance_id for player in hands.game.players if player.device)
        hands.press(0, b if seated == a.instance_id else a)
        assert {player.device.instance_id for player in hands.game.players} == {a.instance_id, b.instance_id}
        hands.press(0, a, b)
        assert all(player.ready for player in hands.game.players)


def test_two_devices_that_never_differ_give_up_the_second_seat(tmp_path):
    copies = [VirtualJoystick("Pad"), VirtualJoystick("Pad")]
    with lobby(tmp_path) as hands:
        for player, pad in zip(hands.game.players, hands.game.roster.pads, strict=True):
            player.person.device = pad
        for step in range(12):
            for pad in copies:
                pad.move(0.05 * step, 0.0)
            hands.ticks()
        assert devices(hands) == ["Pad", None]
        assert "never differ" in hands.panel(1).notice


def test_a_pad_that_nobody_holds_chooses_nothing(tmp_path):
    a, b, spare = (VirtualJoystick(name, product=number) for number, name in enumerate(("A", "B", "Spare")))
    with lobby(tmp_path) as hands:
        hands.press(0, a)
        hands.press(0, b)
        for pad in (a, b):
            hands.press(0, pad)
        hands.ticks(20)
        assert hands.phase == "Ready"
        hands.press(0, spare)
        assert hands.phase == "Ready"


def test_an_episode_of_one_device_is_flagged_and_found_by_check(tmp_path, capsys):
    copies = [VirtualJoystick("Pad"), VirtualJoystick("Pad")]
    with lobby(tmp_path, headless=True, window=None, countdown_s=0.0, episodes=1) as hands:
        hands.ticks(3)
        assert hands.phase == "Running"
        for step in range(30):
            for pad in copies:
                pad.move(0.03 * step, 0.2)
            hands.ticks()
    (path,) = tmp_path.rglob("*.mcap")
    assert "identical_actions" in flags(path)
    assert check(["check", str(path.parent), "--json"]) == 1
    found = [one for one in json.loads(capsys.readouterr().out)["findings"] if one["rule"] == "identical"]
    assert [(one["severity"], one["episode"], one["figure"]) for one in found] == [("error", path.name, 1.0)]


# Other numberings


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


def test_a_pad_that_nobody_knows_is_set_up_in_the_lobby_and_kept(tmp_path):
    strange = VirtualJoystick("Strange pad", product=3, axes=4, buttons=12, hats=0, mapping=None)
    config = tmp_path / "config"
    with lobby(tmp_path) as hands:
        hands.press(5, strange)  # joins with any button
        assert hands.panel().prompt == "button 0: choose   button 1: next"
        assert hands.panel().notice == "the buttons of this pad are not known: set them up"
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
    assert mapping.of_button(11) == "start"
    assert mapping.of_button(7) is None
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


# What steers


def test_a_pad_with_nothing_but_a_hat_steers_by_it(tmp_path):
    plain = VirtualJoystick("Plain", product=4, axes=0, hats=1, mapping=None)
    other = VirtualJoystick("Beta pad", product=2)
    with lobby(tmp_path) as hands:
        hands.press(0, plain)
        assert hands.panel().steering == "d-pad"
        plain.hat(1, -1)
        hands.ticks(1)
        assert hands.panel().force == pytest.approx((0.5**0.5, 0.5**0.5))
        assert hands.panel().notice.startswith("the buttons of this pad")
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
    with lobby(tmp_path, pilots=None) as hands:
        assert [player.spec.kind for player in hands.game.players] == ["keyboard", "keyboard"]


def test_the_axes_that_steer_can_be_chosen_and_are_kept(tmp_path):
    pad = VirtualJoystick("Alpha pad", product=1)
    config = tmp_path / "config"
    with lobby(tmp_path) as hands:
        hands.press(0, pad)
        assert hands.panel().steering == "left stick"
        for _ in range(4):
            hands.press(1, pad)
        hands.press(0, pad)
        assert hands.panel().items[0] == "steer with: left stick"
        pad.hat(1, 0)
        hands.ticks(1)
        pad.hat(0, 0)
        hands.ticks(1)
        seen = [hands.panel().steering]
        for _ in range(2):
            hands.press(0, pad)
            seen.append(hands.panel().steering)
        assert seen == ["d-pad", "left stick", "d-pad"]
        hands.press(1, pad)
        hands.press(0, pad)
        assert hands.panel().items[1] == "left-right inverted: yes"
        pad.hat(1, 0)
        hands.ticks(1)
        assert hands.panel().force == (-1.0, 0.0)
        pad.hat(0, 0)
        for _ in range(2):
            hands.press(1, pad)
        hands.press(0, pad)
        assert hands.panel().items[4] == "steering: d-pad"
    assert CalibrationStore(config).get(pad.guid).axes == (4, 5)


# Sticks off their centre


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
    pads = [VirtualJoystick("Loose", product=6), VirtualJoystick("Sound", product=2)]
    with lobby(tmp_path, headless=True, window=None) as hands:
        hands.ticks(3)
        pads[0].move(0.0, 0.25)
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
    pad = VirtualJoystick("Worn", product=6)
    CalibrationStore(tmp_path / "config").put(pad.guid, StickCalibration(low=(-0.9, -0.9), high=(0.9, 0.9)))
    with lobby(tmp_path) as hands:
        pad.move(0.0, -0.25)
        hands.press(0, pad)
        hands.ticks(20)
        assert hands.panel().notice == ""
        hands.ticks(45)
        assert hands.panel().notice == "pushes with 0.18 at rest: calibrate the stick"
        pad.move(0.0, 0.0)
        hands.ticks(61)
        assert hands.panel().notice == ""


def test_a_changed_dead_zone_is_no_calibration(tmp_path):
    pad = VirtualJoystick("Loose", product=6)
    config = tmp_path / "config"
    with lobby(tmp_path) as hands:
        hands.press(0, pad)
        for _ in range(3):
            hands.press(1, pad)
        hands.press(0, pad)
        assert hands.panel().items[3] == "dead zone  0.13"
    assert pad.guid not in CalibrationStore(config)
    # Files did not say before whether a centre was measured.
    entries = json.loads((config / "calibrations.json").read_text(encoding="utf-8"))
    assert entries[pad.guid].pop("measured") is False
    (config / "calibrations.json").write_text(json.dumps(entries), encoding="utf-8")
    assert pad.guid not in CalibrationStore(config)


# The box before the start


def test_the_box_before_the_start_hides_nothing_of_the_world(tmp_path):
    pads = [VirtualJoystick("Alpha pad", product=1), VirtualJoystick("Beta pad", product=2)]
    with lobby(tmp_path, countdown_s=30.0) as hands:
        for pad in pads:
            hands.press(0, pad)
        for pad in pads:
            hands.press(0, pad)
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
            hands.press(0, pads[0])
