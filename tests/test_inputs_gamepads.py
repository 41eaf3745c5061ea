"""Virtual joysticks take the whole way of real ones: SDL's events, instance ids, unplugging."""

import pytest
from virtual_joystick import VirtualJoystick

from copolicy.collect.inputs import HALVES, Command, CommandReader, Gamepads, Press, keyboard_force
from copolicy.collect.inputs.gamepads import InputSample
from copolicy.collect.sdl import pygame


@pytest.fixture
def gamepads():
    pygame.display.init()
    pygame.display.set_mode((64, 64))
    yield Gamepads()
    pygame.joystick.quit()
    pygame.display.quit()


def _pump(gamepads, reader=None):
    """Hands on all events; returns what came, what went, and the presses."""
    came, went, presses = [], [], []
    for event in pygame.event.get():
        added, removed = gamepads.handle(event)
        came += [added] if added else []
        went += [removed] if removed else []
        press = reader.read(event) if reader else None
        presses += [press] if press else []
    return came, went, presses


def test_two_of_a_kind_are_told_apart(gamepads):
    first, second = VirtualJoystick("Twin"), VirtualJoystick("Twin")
    came, _, _ = _pump(gamepads)
    assert [gamepad.instance_id for gamepad in came] == [first.instance_id, second.instance_id]
    assert came[0].guid == came[1].guid
    first.move(0.5, -1.0)
    second.move(-0.25, 0.0)
    _pump(gamepads)
    assert gamepads.get(first.instance_id).sample(7).axes[:2] == pytest.approx((0.5, -1.0), abs=1e-4)
    assert gamepads.get(second.instance_id).sample(7).axes[:2] == pytest.approx((-0.25, 0.0), abs=1e-4)
    assert gamepads.get(first.instance_id).sample(7).time_ns == 7


def test_a_gamepad_that_comes_back_is_another(gamepads):
    gamepad = VirtualJoystick()
    _pump(gamepads)
    number = gamepad.instance_id
    gamepad.unplug()
    _, went, _ = _pump(gamepads)
    assert [gamepad.instance_id for gamepad in went] == [number]
    assert gamepads.get(number) is None
    assert len(gamepads) == 0
    replugged = VirtualJoystick()
    came, _, _ = _pump(gamepads)
    assert came[0].instance_id == replugged.instance_id != number


def test_an_event_that_is_told_twice_opens_one_gamepad(gamepads):
    VirtualJoystick()
    (event,) = pygame.event.get(pygame.JOYDEVICEADDED)
    assert gamepads.handle(event)[0] is not None
    assert gamepads.handle(event) == (None, None)
    assert len(gamepads) == 1


def test_buttons_hat_and_stick_become_commands(gamepads):
    gamepad, reader = VirtualJoystick(), CommandReader(gamepads)
    _pump(gamepads)
    number = gamepad.instance_id
    for button, command in ((0, Command.ACCEPT), (1, Command.BACK), (7, Command.PAUSE)):
        gamepad.button(button, True)
        assert _pump(gamepads, reader)[2] == [Press(command, number)]
        gamepad.button(button, False)
        assert _pump(gamepads, reader)[2] == []
    gamepad.hat(0, 1)
    assert _pump(gamepads, reader)[2] == [Press(Command.UP, number)]
    gamepad.hat(0, 0)
    assert _pump(gamepads, reader)[2] == []


def test_a_stick_commands_once_each_time_it_is_tipped(gamepads):
    gamepad, reader = VirtualJoystick(), CommandReader(gamepads)
    _pump(gamepads)
    commands = []
    for y in (0.5, 0.9, 0.7, 0.5, 0.9, 0.1, -0.9):
        gamepad.axis(1, y)
        commands.append([press.command for press in _pump(gamepads, reader)[2]])
        assert all(press.moved for press in _pump(gamepads, reader)[2])
    assert commands == [[], [Command.DOWN], [], [], [], [], [Command.UP]]


@pytest.mark.parametrize(
    ("key", "command", "device"),
    [
        (pygame.K_e, Command.ACCEPT, "wasd"),
        (pygame.K_RETURN, Command.ACCEPT, "arrows"),
        (pygame.K_UP, Command.UP, "arrows"),
        (pygame.K_k, Command.KEEP, "keyboard"),
    ],
)
def test_keys_belong_to_a_half_or_to_the_keyboard(key, command, device):
    event = pygame.event.Event(pygame.KEYDOWN, key=key)
    assert CommandReader().read(event) == Press(command, device)


def test_a_key_without_a_meaning_is_none():
    assert CommandReader().read(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_F7)) is None


def test_the_halves_share_no_key():
    keys = [key for half in HALVES.values() for key in (*half.keys, half.accept_key, half.next_key)]
    assert len(set(keys)) == len(keys)


@pytest.mark.parametrize(
    ("axes", "force"), [((1.0, 0.0), (1.0, 0.0)), ((0.0, 0.0), (0.0, 0.0)), ((1.0, -1.0), (0.5**0.5, -(0.5**0.5)))]
)
def test_diagonal_keys_push_no_harder(axes, force):
    assert keyboard_force(InputSample(axes, (), 0)) == pytest.approx(force)
