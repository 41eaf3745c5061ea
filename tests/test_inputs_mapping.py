"""What the buttons of a gamepad mean, by SDL's words, by the user's file, and by what is printed on them."""

from typing import Literal

import pytest
from virtual_joystick import PLAYSTATION, XBOX, VirtualJoystick

from copolicy.collect.inputs import (
    CalibrationStore,
    Command,
    CommandReader,
    GamepadMapping,
    Gamepads,
    MappingRun,
    MappingStore,
    Press,
    StickCalibration,
)
from copolicy.collect.inputs.mapping import UNKNOWN, Binding, Labels
from copolicy.collect.inputs.steering import steering_options
from copolicy.collect.sdl import pygame
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError

SONY, NINTENDO, OTHER = "050000004c050000cc09000000000000", "030000007e0500000920000000000000", "0" * 32


@pytest.fixture
def events(own_joysticks):
    """SDL's queue, with joysticks of its own."""
    return pygame.event


def mapping(text: str, name: str = "Gamepad", source: Literal["sdl", "user"] = "sdl") -> GamepadMapping:
    return GamepadMapping.parse(name, dict(part.split(":") for part in text.split(",")), source)


@pytest.mark.parametrize("text", ["b0", "a11", "a1~", "+a2", "-a2", "h0.8"])
def test_a_binding_is_written_as_it_is_read(text):
    assert str(Binding.parse(text)) == text


@pytest.mark.parametrize("text", ["", "c0", "b", "b0.1", "h0", "h0.3", "b1~", "+b1", "a1.2"])
def test_other_bindings_are_refused(text):
    with pytest.raises(InvalidValueError, match="binding: expected a button b0"):
        Binding.parse(text)


def test_sdls_mapping_decides_what_a_button_asks_for(events):
    xbox = VirtualJoystick("Xbox pad", 0x045E, 0x028E, buttons=11)
    sony = VirtualJoystick("Wireless Controller", 0x054C, 0x09CC, axes=6, buttons=13, mapping=PLAYSTATION)
    strange = VirtualJoystick("Strange", product=3, buttons=13, mapping=None)
    gamepads = Gamepads()
    reader = CommandReader(gamepads)
    events.get()

    def pressed(gamepad):
        found = []
        for button in range(11):
            gamepad.button(button, True)
            found += [press for event in events.get() if (press := reader.read(event)) is not None]
            gamepad.button(button, False)
            events.get()
        assert all(press.device == gamepad.instance_id for press in found)
        return [press.command.name for press in found]

    assert pressed(xbox)[:9] == "ACCEPT BACK REDO DISCARD NOTE UNDO PAUSE PAUSE OTHER".split()
    assert pressed(sony)[:10] == "REDO ACCEPT BACK DISCARD NOTE UNDO OTHER OTHER PAUSE PAUSE".split()
    # A trigger may have any number on an unknown gamepad.
    assert pressed(strange) == "ACCEPT BACK REDO DISCARD".split() + ["OTHER"] * 7


def test_a_stick_that_is_mapped_upside_down_moves_the_cursor_the_right_way(events):
    gamepad = VirtualJoystick("Odd", product=4, mapping="a:b0,leftx:a2,lefty:a3~")
    gamepads = Gamepads()
    reader = CommandReader(gamepads)
    events.get()
    gamepad.axis(3, -0.9)
    presses = [press for event in events.get() if (press := reader.read(event)) is not None]
    assert presses == [Press(Command.DOWN, gamepad.instance_id, moved=True)]
    (opened,) = gamepads
    assert opened.default_calibration() == StickCalibration(axes=(2, 3), invert=(False, True))
    assert opened.force(opened.sample(0), opened.default_calibration())[1] == pytest.approx(0.886, abs=1e-3)


@pytest.mark.parametrize(
    ("guid", "name", "source", "labels"),
    [
        (SONY, "anything", "sdl", "Cross Circle Square Triangle Options"),
        (SONY, "anything", "user", "Cross Circle Square Triangle Options"),
        (OTHER, "PS3 Controller", "sdl", "Cross Circle Square Triangle Start"),
        (OTHER, "HORI pad for PS5", "sdl", "Cross Circle Square Triangle Options"),
        (NINTENDO, "Pro Controller", "sdl", "A B X Y +"),
        (OTHER, "Xbox 360 Controller", "sdl", "A B X Y Menu"),
        (OTHER, "Logitech F310", "sdl", "A B X Y Menu"),
        (OTHER, "USB gamepad", "user", "button0 button1 button2 button3 button7"),
    ],
)
def test_labels_are_those_of_the_maker(guid, name, source, labels):
    printed = Labels(mapping(XBOX, name, source), name, guid)
    assert [printed[control].replace(" ", "") for control in ("a", "b", "x", "y", "start")] == labels.split()
    assert printed["misc1"] == ""


def test_buttons_of_an_unknown_gamepad_go_by_their_numbers():
    printed = Labels(UNKNOWN, "Wireless Controller", SONY)
    assert (printed["a"], printed["b"], printed["start"]) == ("button 0", "button 1", "")


@pytest.mark.parametrize(
    ("text", "axes", "hats", "labels"),
    [
        (XBOX, 6, 1, ["left stick", "d-pad"]),
        (PLAYSTATION, 6, 1, ["left stick", "right stick", "d-pad"]),
        ("a:b0,dpleft:-a0,dpright:+a0,dpup:-a1,dpdown:+a1", 2, 0, ["d-pad"]),
        ("a:b0,dpleft:b4,dpright:b5,dpup:b6,dpdown:b7", 0, 0, ["d-pad"]),
        ("a:b0,-leftx:b4,+leftx:b5,-lefty:b6,+lefty:b7", 0, 0, ["d-pad"]),
        ("a:b0", 3, 0, ["axes 0 and 1", "axes 1 and 2"]),
        ("a:b0", 0, 2, ["d-pad 1", "d-pad 2"]),
        ("a:b0,leftx:a4,lefty:a5", 1, 0, []),
    ],
)
def test_everything_that_can_steer_is_on_offer(text, axes, hats, labels):
    assert [option.label for option in steering_options(mapping(text), axes, hats)] == labels


def test_a_d_pad_of_buttons_steers(events):
    gamepad = VirtualJoystick("Retro", product=5, axes=0, hats=0, mapping="a:b0,dpleft:b4,dpright:b5,dpup:b6,dpdown:b7")
    (opened,) = Gamepads()
    calibration = opened.default_calibration()
    assert opened.steering(calibration).digital
    gamepad.button(5, True)
    gamepad.button(6, True)
    events.get()
    assert opened.force(opened.sample(0), calibration) == pytest.approx((0.5**0.5, -(0.5**0.5)))


def test_a_calibration_of_axes_that_a_gamepad_lacks_is_not_its_own(events, tmp_path):
    gamepad = VirtualJoystick("Plain", product=6, axes=0, mapping=None)
    store = CalibrationStore(tmp_path)
    store.put(gamepad.guid, StickCalibration(axes=(2, 3), dead_zone=0.3))
    (opened,) = Gamepads()
    assert store.for_gamepad(opened).axes == (0, 1)
    store.put(gamepad.guid, StickCalibration(dead_zone=0.3))
    assert store.for_gamepad(opened).dead_zone == 0.3


# The user's file


def test_a_line_of_the_communitys_list_is_for_every_gamepad_of_its_numbers(tmp_path):
    path = tmp_path / "gamecontrollerdb.txt"
    lines = [
        "# remarks stay",
        f"{SONY},PS4 Controller,{PLAYSTATION},platform:Linux,",
        f"{NINTENDO},Pro Controller,{XBOX},platform:Windows,",
    ]
    path.write_text("\r\n".join(lines), encoding="utf-8-sig")
    store = MappingStore(tmp_path)
    with_name = f"{SONY[:4]}ab12{SONY[8:]}"
    stored = store.get(with_name)
    assert stored is not None
    assert stored.control_of_button(9) == "start"
    assert store.get(NINTENDO) is None  # of another system
    store.put(OTHER, mapping("a:b4"))
    store.put(OTHER, mapping("a:b5,leftx:a1~", name="A, B"))
    reread = MappingStore(tmp_path).get(OTHER)
    assert reread is not None
    assert (reread.name, reread.control_of_button(5), reread.source) == ("A  B", "a", "user")
    assert path.read_text(encoding="utf-8").splitlines() == [*lines, f"{OTHER},A  B,a:b5,leftx:a1~,"]


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("garbage", "expected GUID,name,a:b0,b:b1,..., found 'garbage'"),
        (f"{OTHER},Gamepad,a:b0,b", "expected entries such as a:b0, found 'b'"),
        (f"{OTHER},Gamepad,a:c0", "found 'c0'"),
        (f"{OTHER},Gamepad", "expected at least one control"),
        (f"{OTHER},Gamepad,A B:b0", "expected a name of SDL's"),
    ],
)
def test_a_damaged_line_is_named(tmp_path, line, found):
    path = tmp_path / "gamecontrollerdb.txt"
    path.write_text(f"\n{line}\n", encoding="utf-8")
    with pytest.raises(FileFormatError) as error:
        MappingStore(tmp_path)
    assert str(error.value).startswith(f"{path}: expected a mapping in SDL's format in line 2, found ")
    assert found in str(error.value)


def test_the_users_mapping_goes_before_sdls(events, tmp_path):
    gamepad = VirtualJoystick("Alpha pad", product=1)
    store = MappingStore(tmp_path)
    (opened,) = Gamepads(store)
    assert (opened.mapping.source, opened.mapping.control_of_button(7)) == ("sdl", "start")
    store.put(gamepad.guid, mapping("a:b3,b:b4,leftx:a0,lefty:a1"))
    (opened,) = Gamepads(MappingStore(tmp_path))
    assert (opened.mapping.source, opened.mapping.control_of_button(7), opened.mapping.control_of_button(3)) == (
        "user",
        None,
        "a",
    )


# Setting up a gamepad


def _button(index):
    return pygame.event.Event(pygame.JOYBUTTONDOWN, button=index, instance_id=0)


def _axis(index, value):
    return pygame.event.Event(pygame.JOYAXISMOTION, axis=index, value=value, instance_id=0)


def _hat(x, y):
    return pygame.event.Event(pygame.JOYHATMOTION, hat=0, value=(x, y), instance_id=0)


BUTTONS = [_button(index) for index in (3, 3, 1, 9, 3, 3, 3, 3)]  # back cannot be left out


@pytest.mark.parametrize(
    ("axes", "hats", "steer", "text", "expected"),
    [
        (
            [0.0, 0.0, -1.0],
            1,
            [_axis(2, -0.8), _axis(0, 0.3), _axis(0, 0.9), _axis(0, 0.7), _axis(0, -0.9), _axis(1, -0.8)],
            "a:b3,b:b1,start:b9,leftx:a0,lefty:a1~",
            ((0, 1), (False, True)),
        ),
        (
            [0.0, 0.0],
            1,
            [_hat(0, 1), _hat(1, 1), _hat(1, 0), _hat(0, 0), _hat(-1, 0), _hat(0, -1)],
            "a:b3,b:b1,start:b9,dpup:h0.1,dpright:h0.2,dpdown:h0.4,dpleft:h0.8",
            ((2, 3), (False, False)),
        ),
        (
            [],
            0,
            [_button(3), _button(11), _button(11), _button(12), _button(13), _button(14)],
            "a:b3,b:b1,start:b9,dpright:b11,dpdown:b12,dpleft:b13,dpup:b14",
            ((0, 1), (False, False)),
        ),
    ],
)
def test_a_mapping_is_made_by_doing_what_is_asked(axes, hats, steer, text, expected):
    run = MappingRun("Strange", axes, hats)
    for event in (*BUTTONS, *steer):
        assert not run.done
        assert run.prompt
        run.handle(event)
    assert (run.done, run.prompt, run.progress) == (True, "", 1.0)
    made, *steering = run.result()
    assert made == mapping(text, "Strange", "user")
    assert tuple(steering) == expected
    run.handle(_button(5))
    assert run.result()[0] == made
