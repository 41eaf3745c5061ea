"""One gamepad that the system lists twice is one player."""

import json

import pytest
from gamepad_lobby import devices, flags, lobby
from virtual_joystick import VirtualJoystick

from copolicy.dataset.cli import main as check

pytestmark = pytest.mark.usefixtures("own_joysticks")


def test_one_press_on_a_gamepad_that_is_listed_twice_seats_one_player(tmp_path):
    copies = [VirtualJoystick("Gamepad"), VirtualJoystick("Gamepad")]
    with lobby(tmp_path) as hands:
        for _ in range(4):
            hands.press(0, *copies)
        assert devices(hands) == ["Gamepad", None]
        assert [player.ready for player in hands.game.players] == [True, False]
        hands.ticks(40)
        assert hands.phase == "Lobby"
        assert hands.panel(1).notice == (
            "Gamepad and the other gamepad were pressed at once: press one alone, it may be listed twice"
        )
        # The other player has another gamepad.
        third = VirtualJoystick("Other pad", product=2)
        hands.ticks(2)
        hands.press(0, third)
        assert devices(hands) == ["Gamepad", "Other pad"]
        journal = (hands.game.folder.path / "journal.jsonl").read_text(encoding="utf-8")
        assert '"refused"' in journal


def test_a_copy_that_comes_a_tick_later_is_no_second_player_either(tmp_path):
    first, copy = VirtualJoystick("Gamepad"), VirtualJoystick("Gamepad")
    with lobby(tmp_path) as hands:
        for down in (True, False):
            first.button(0, down)
            hands.ticks()
            copy.button(0, down)
            hands.ticks(5)
        assert devices(hands) == ["Gamepad", None]


def test_two_people_with_gamepads_of_one_make_join_and_may_press_at_the_same_moment(tmp_path):
    a, b = VirtualJoystick("Gamepad"), VirtualJoystick("Gamepad")
    with lobby(tmp_path) as hands:
        hands.press(0, a, b)
        assert devices(hands) == ["Gamepad", None]
        (seated,) = (player.device.instance_id for player in hands.game.players if player.device)
        hands.press(0, b if seated == a.instance_id else a)
        assert {player.device.instance_id for player in hands.game.players} == {a.instance_id, b.instance_id}
        hands.press(0, a, b)
        assert all(player.ready for player in hands.game.players)


def test_two_devices_that_never_differ_give_up_the_second_seat(tmp_path):
    copies = [VirtualJoystick("Gamepad"), VirtualJoystick("Gamepad")]
    with lobby(tmp_path) as hands:
        for player, gamepad in zip(hands.game.players, hands.game.roster.gamepads, strict=True):
            player.person.device = gamepad
        for step in range(12):
            for gamepad in copies:
                gamepad.move(0.05 * step, 0.0)
            hands.ticks()
        assert devices(hands) == ["Gamepad", None]
        assert "never differ" in hands.panel(1).notice


def test_a_gamepad_that_nobody_holds_chooses_nothing(tmp_path):
    a, b, spare = (VirtualJoystick(name, product=number) for number, name in enumerate(("A", "B", "Spare")))
    with lobby(tmp_path) as hands:
        hands.press(0, a)
        hands.press(0, b)
        for gamepad in (a, b):
            hands.press(0, gamepad)
        hands.ticks(20)
        assert hands.phase == "Ready"
        hands.press(0, spare)
        assert hands.phase == "Ready"


def test_an_episode_of_one_device_is_flagged_and_found_by_check(tmp_path, capsys):
    copies = [VirtualJoystick("Gamepad"), VirtualJoystick("Gamepad")]
    with lobby(tmp_path, headless=True, window=None, countdown_s=0.0, episodes=1) as hands:
        hands.ticks(3)
        assert hands.phase == "Running"
        for step in range(30):
            for gamepad in copies:
                gamepad.move(0.03 * step, 0.2)
            hands.ticks()
    (path,) = tmp_path.rglob("*.mcap")
    assert "identical_actions" in flags(path)
    assert check(["check", str(path.parent), "--json"]) == 1
    findings = [
        finding for finding in json.loads(capsys.readouterr().out)["findings"] if finding["rule"] == "identical"
    ]
    assert [(finding["severity"], finding["episode"], finding["figure"]) for finding in findings] == [
        ("error", path.name, 1.0)
    ]
