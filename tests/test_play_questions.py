"""Questionnaires and breaks in the window, answered with a gamepad and with keys."""

import json
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from typing import Any

import pytest
from gamepad_lobby import Hands
from own_questionnaire import OWN
from play_session import settings
from virtual_joystick import VirtualJoystick

from copolicy.collect.play.answer_sheet import AnswerSheet
from copolicy.collect.play.interludes import Interlude
from copolicy.collect.play.phase import NextPhase, before_next_episode
from copolicy.collect.play.questions import Questions
from copolicy.collect.play.session_run import prepared
from copolicy.collect.play.settings import PlayerSpec, PlaySettings
from copolicy.collect.questionnaire import AnswerFile, Questionnaire, read_questionnaire
from copolicy.collect.screen.text import fitted_lines, wrapped
from copolicy.collect.sdl import pygame

pytestmark = pytest.mark.usefixtures("own_joysticks")

FORM = Questionnaire.from_json(json.dumps(OWN), "own")
A, B, START = 0, 1, 7


@dataclass(frozen=True)
class Asked(PlaySettings):
    """Two blocks of one episode, a questionnaire after each and a break between them."""

    forms: tuple[Questionnaire, ...] = (FORM,)

    def interludes(self) -> tuple[Interlude, ...]:
        return (Interlude(1, 1, self.forms, 30.0), Interlude(2, 2, self.forms, 30.0))

    def session_settings(self) -> dict[str, str]:
        return {"study_plan": "abcd"}


@contextmanager
def session(tmp_path, human="joystick", **changes):
    """The window of a session whose robot is scripted; at its start the first block is over."""
    players = (PlayerSpec("scripted", "S01"), PlayerSpec(human, "S02" if human == "scripted" else ""))
    usual = settings(tmp_path, players=players, episodes=2, may_exchange_seats=False)
    made = Asked(**({field.name: getattr(usual, field.name) for field in fields(usual)} | changes))
    with prepared(made) as application:
        application.phase.enter()
        yield Hands(application)


def open_phase(hands) -> Any:
    return hands.application.phase


def enter_questions(hands, gamepad):
    hands.press(A, gamepad)  # joins
    hands.game.folder.counts.kept_in_session["map", 0] = 1
    hands.game.interludes.kept(1)
    hands.press(A, gamepad)  # agrees
    hands.ticks(32)
    assert hands.phase == "Questions"


def push(hands, gamepad, x, ticks=3):
    gamepad.move(x, 0.0)
    hands.ticks(ticks)
    gamepad.move(0.0, 0.0)
    hands.ticks(3)


def saved(tmp_path):
    return AnswerFile(next((tmp_path / "recordings").glob("P01-*"))).values(1, "own")


def test_a_gamepad_answers_and_each_answer_is_on_the_disk_at_once(tmp_path):
    gamepad = VirtualJoystick("Pad", product=3)
    with session(tmp_path) as hands:
        enter_questions(hands, gamepad)
        hands.press(A, gamepad)  # no mark yet: stays, and says what to do
        assert hands.game.toast == "move the mark to the left or right"
        push(hands, gamepad, 1.0)  # in the middle
        push(hands, gamepad, 1.0)
        assert saved(tmp_path) == {}
        hands.press(A, gamepad)
        assert saved(tmp_path) == {"one": 6.0}
        hands.press(A, gamepad)  # the second item has no mark yet
        push(hands, gamepad, -1.0, ticks=60)  # held: to the end
        hands.ticks(20)  # a mark that rests is saved without a button
        assert saved(tmp_path) == {"one": 6.0, "two": 0.0}
        hands.press(B, gamepad)  # back to the first
        push(hands, gamepad, -1.0)
        hands.press(A, gamepad)
        assert saved(tmp_path) == {"one": 4.0, "two": 0.0}
        hands.press(A, gamepad)
        assert open_phase(hands).sheet.item is None  # the button
        hands.press(A, gamepad)
        assert hands.phase == "Break"
        lines = [
            json.loads(line) for line in hands.game.interludes.answers.path.read_text(encoding="utf-8").splitlines()
        ]
        assert {(line["study"], line["participant"], line["block"], line["source"]) for line in lines} == {
            ("abcd", "P01", 1, "human")
        }


def test_the_break_lasts_and_then_waits_for_the_person(tmp_path, monkeypatch):
    gamepad = VirtualJoystick("Pad", product=3)
    with session(tmp_path, forms=()) as hands:
        hands.press(A, gamepad)
        hands.game.folder.counts.kept_in_session["map", 0] = 1
        hands.game.interludes.kept(1)
        hands.press(A, gamepad)
        hands.ticks(20)
        assert hands.phase == "Break"
        hands.press(A, gamepad)
        assert (hands.phase, hands.game.toast) == ("Break", "please rest a little longer")
        assert open_phase(hands).remaining_s > 20
        later = hands.game.clock() + 31 * 10**9
        monkeypatch.setattr(type(hands.game.clock), "__call__", lambda clock: later)
        hands.ticks(2)
        hands.press(A, gamepad)
        assert hands.phase == "Ready"
        assert "swap" not in [value for _, value in open_phase(hands).top.items]
        assert before_next_episode(hands.game) is NextPhase.READY  # the break is over


def key(code):
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=code, unicode="", mod=0))


def test_keys_answer_by_digit_and_the_session_goes_on_with_the_open_question(tmp_path):
    form = replace(read_questionnaire("fluency"), name="own")
    with session(tmp_path, "keyboard", forms=(form,)) as hands:
        key(pygame.K_RETURN)  # joins with the arrows
        hands.ticks(3)
        hands.game.folder.counts.kept_in_session["map", 0] = 1
        key(pygame.K_RETURN)
        hands.ticks(32)
        assert hands.phase == "Questions"
        for number in (7, 1, 9):  # nine is no mark
            key(getattr(pygame, f"K_{number}"))
            hands.ticks(1)
            key(pygame.K_RETURN)
            hands.ticks(1)
        names = [item.name for item in form.items]
        assert saved(tmp_path) == {names[0]: 7.0, names[1]: 1.0}
        key(pygame.K_5)
        hands.ticks(1)
        key(pygame.K_ESCAPE)
        hands.ticks(1)
        key(pygame.K_DOWN)
        key(pygame.K_RETURN)  # quit for now
        hands.application._tick(hands.game.ticker.tick())
        assert hands.game.stop == "quit"
        hands.application.phase.leave()
    assert saved(tmp_path) == {names[0]: 7.0, names[1]: 1.0, names[2]: 5.0}
    with session(tmp_path, "keyboard", forms=(form,)) as hands:
        assert hands.game.folder.continued
        key(pygame.K_RETURN)
        hands.ticks(3)
        hands.game.folder.counts.kept_in_session["map", 0] = 1
        key(pygame.K_RETURN)
        hands.ticks(32)
        assert hands.phase == "Questions"
        assert (open_phase(hands).sheet.page, open_phase(hands).sheet.row) == (0, 3)
        assert hands.screen().get_size() == (1200, 760)


def test_answers_are_asked_for_when_all_episodes_are_kept_and_nobody_is_asked_without_a_window(tmp_path):
    with session(tmp_path) as hands:
        game = hands.game
        game.folder.counts.kept_in_session["map", 0] = 2
        assert not game.finished
        assert before_next_episode(game) is NextPhase.QUESTIONS
        for block in (1, 2):
            for item in FORM.items:
                game.interludes.answers._values[block, "own", item.name] = 2.0
        assert game.finished
        assert before_next_episode(game) is NextPhase.FINISHED
    gamepad = VirtualJoystick("Pad", product=3)
    assert gamepad
    with session(tmp_path, headless=True, window=None) as hands:
        assert hands.game.settings.answered_by() == ""
        assert hands.game.open_questionnaire() is None


def test_a_session_without_people_answers_at_random_and_says_so(tmp_path):
    values = []
    for seed in (0, 0, 1):
        with session(tmp_path / str(len(values)), "scripted", headless=True, window=None, seed=seed) as hands:
            hands.game.folder.counts.kept_in_session["map", 0] = 1
            assert before_next_episode(hands.game) is NextPhase.QUESTIONS
            hands.application.phase = Questions(hands.game)
            hands.ticks(1)
            assert hands.phase == "Ready"
            text = hands.game.interludes.answers.path.read_text(encoding="utf-8")
            assert {json.loads(line)["source"] for line in text.splitlines()} == {"simulated"}
            values.append(hands.game.interludes.answers.values(1, "own"))
    assert values[0] == values[1]
    assert values[0] != values[2]


class Seconds:
    """A clock that the test sets, s."""

    now = 100.0

    def __call__(self):
        return round(self.now * 1e9)


def test_an_answer_has_the_seconds_from_the_selection_of_its_item_to_the_last_move_of_its_mark():
    clock = Seconds()
    sheet = AnswerSheet(FORM, {}, clock)
    clock.now += 4
    sheet.move(1)
    clock.now += 2.5
    sheet.move(1)
    clock.now += 7  # resting on the mark is no time of thought
    sheet.accept()
    assert list(sheet.changed()) == [("one", 6.0, 6.5)]
    clock.now += 3
    sheet.place(0)
    assert list(sheet.changed()) == [("two", 0.0, 3.0)]
    sheet.select(0)
    clock.now += 1.25
    sheet.move(-1)
    assert list(sheet.changed()) == [("one", 4.0, 1.25)]
    assert list(sheet.changed()) == []


def test_a_sheet_leads_through_its_pages_and_an_answer_that_was_not_written_stays_unsaved():
    form = replace(read_questionnaire("fluency"), name="own")
    names = [item.name for item in form.items]
    sheet = AnswerSheet(form, dict.fromkeys(names[:6], 3.0), Seconds())
    assert (sheet.page, sheet.row, sheet.item) == (1, 0, form.items[6])
    sheet.select(6)
    assert sheet.accept() == "6 answers are missing"
    assert sheet.row == 0
    for _ in range(6):
        assert sheet.accept() == "move the mark to the left or right"
        sheet.place(2)
        assert sheet.accept() == ""
    assert (sheet.item, sheet.on_last_page) == (None, False)
    assert sheet.accept() == ""
    assert (sheet.page, sheet.row, sheet.on_last_page, sheet.position) == (
        2, 0, True, "page 3 of 3, 12 of 18 answered"
    )  # fmt: skip
    sheet.select(-1)  # back over the edge of the page
    assert (sheet.page, sheet.item) == (1, form.items[11])
    for name, _, _ in sheet.changed():
        if name == names[8]:
            break  # the disk is full
    assert [name for name, _, _ in sheet.changed()] == names[8:12]


def test_a_long_question_is_drawn_whole_in_a_smaller_font():
    text = " ".join(f"word{number}" for number in range(35))
    assert 230 < len(text) <= 240
    for most, largest in ((3, 27), (2, 24)):
        size, lines = fitted_lines(text, largest, 540, most)
        assert " ".join(lines) == text
        assert len(wrapped(text, largest, 540)) > most, "the test needs a text that is too long"
        assert size * len(lines) <= largest * most
    assert fitted_lines("short", 27, 540, 3) == (27, ["short"])
