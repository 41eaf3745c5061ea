"""The phase of a questionnaire, answered with a gamepad or with keys."""

import zlib
from typing import ClassVar

import numpy as np

from ..inputs import Command, Gamepad, Press
from ..questionnaire import Answer
from ..screen import Canvas
from ..screen.dialogs import Line, draw_dialog
from ..screen.palette import YELLOW
from ..screen.questions_view import QuestionRow, QuestionsView, draw_questions
from ..sdl import pygame
from ..ticker import Tick
from .answer_sheet import AnswerSheet
from .game import Game
from .menu import Menu
from .phase import NextPhase, Phase, before_next_episode

_IGNORED_TICKS = 12  # a button pressed this early was still meant for the episode
_HELD_TICKS, _REPEAT_TICKS = 12, 2  # a held stick moves the mark again after the first, then after each second
_SAVE_TICKS = 15  # a mark that rests is saved
_UNATTENDED_TICKS = 3  # between the answers of a session without people
_DIGITS = {getattr(pygame, f"{prefix}{number}"): number for number in range(10) for prefix in ("K_", "K_KP")}


class Questions(Phase):
    """Shows the items of the questionnaire that is due, page by page; each answer is saved before the next is given.

    Up and down select an item, left and right move its mark, which the person has to place: no mark is there before.
    The name of the robot is not shown. In a session without people random answers are given, marked as simulated.
    """

    directions: ClassVar = {Command.LEFT: -1, Command.RIGHT: 1}

    def __init__(self, game: Game):
        super().__init__(game)
        due = game.open_questionnaire()
        assert due is not None, "the phase needs a questionnaire"
        self.interlude, self.form = due
        self._source = game.settings.answered_by()
        saved = game.interludes.answers.values(self.interlude.block, self.form.name)
        self.sheet = AnswerSheet(self.form, saved, game.clock)
        self._ticks = self._still_ticks = self._held_ticks = 0
        self._released = False  # a stick that is held from the episode on does not move a mark
        self._quit_menu: Menu | None = None

    def enter(self) -> None:
        """Writes an entry to the journal."""
        self.game.folder.journal("questions", block=self.interlude.block, questionnaire=self.form.name)

    def consume(self, event: pygame.event.Event) -> bool:
        """Takes a digit as the answer where the scale's marks are digits."""
        scale, number = self.form.scale, _DIGITS.get(event.key) if event.type == pygame.KEYDOWN else None
        if number is None or self.sheet.item is None or self._quit_menu or scale.marks > 10 or scale.high > 9:
            return False
        if (mark := scale.mark(number)) is not None:
            self._moved(self.sheet.place(mark))
        return True

    def handle(self, press: Press) -> None:
        """Selects items, moves marks and pages; PAUSE asks whether to quit."""
        if self._ticks < _IGNORED_TICKS:
            return
        if self._quit_menu is not None:
            self._answer_quit_menu(press)
        elif press.command in self.directions:
            self._moved(self.sheet.move(self.directions[press.command]))
        elif press.command in (Command.UP, Command.BACK):
            self._select(self.sheet.row - 1)
        elif press.command == Command.DOWN:
            self._select(self.sheet.row + 1)
        elif press.command == Command.ACCEPT:
            self._accept()
        elif press.command == Command.PAUSE:
            self._quit_menu = Menu("Stop here?", [("go on", "stay"), ("quit for now", "quit")])

    def tick(self, tick: Tick) -> NextPhase:
        """Repeats a held direction and saves a mark that rests; leads on when every item is answered."""
        game = self.game
        self._ticks += 1
        try:
            if self._source == "simulated":
                self._answer_by_itself()
            elif self._quit_menu is None:
                self._repeat_held()
            self._still_ticks += 1
            if self._still_ticks >= _SAVE_TICKS or self.sheet.done or game.stop:
                self._save()
        except OSError as error:
            game.problem = error.strerror or str(error)
            return NextPhase.FAILURE
        if game.stop:
            return NextPhase.END
        return before_next_episode(game) if self.sheet.done else NextPhase.STAY

    def leave(self) -> None:
        """Saves a mark that still moved when the session was ended.

        Raises:
            OSError: it cannot be written.
        """
        self._save()

    def _moved(self, moved: bool) -> None:
        if moved:
            self._still_ticks = 0
            self.game.sounds.play("choose")

    def _select(self, row: int) -> None:
        self._still_ticks = _SAVE_TICKS  # saved in this tick
        self.sheet.select(row)

    def _accept(self) -> None:
        self._still_ticks = _SAVE_TICKS
        if missing := self.sheet.accept():
            self.game.show_message(missing)

    def _answer_quit_menu(self, press: Press) -> None:
        assert self._quit_menu is not None
        choice = self._quit_menu.handle(press)
        if choice == "quit":
            self.game.stop = self.game.stop or "quit"
        if choice is not None:
            self._quit_menu = None

    def _repeat_held(self) -> None:
        direction = self._held_direction()
        self._released = self._released or not direction
        self._held_ticks = self._held_ticks + 1 if direction and self._released else 0
        if self._held_ticks > _HELD_TICKS and self._held_ticks % _REPEAT_TICKS == 0:
            self._moved(self.sheet.move(direction))

    def _held_direction(self) -> int:
        """-1 or 1 while a person holds a stick, a d-pad or a key to the left or right."""
        for player in self.game.players:
            if player.person is None or player.device is None:
                continue
            sample = player.person.sample()
            values = [player.person.force(sample)[0]]
            if isinstance(player.device, Gamepad):
                values += sample.directions[::2]
            for value in values:
                if abs(value) > 0.65:
                    return 1 if value > 0 else -1
        pressed = pygame.key.get_pressed()
        return int(pressed[pygame.K_RIGHT]) - int(pressed[pygame.K_LEFT])

    def _answer_by_itself(self) -> None:
        """Gives random answers, the same for the same seed, participant, block and item."""
        sheet, settings = self.sheet, self.game.settings
        while not sheet.done and (settings.headless or self._ticks % _UNATTENDED_TICKS == 0):
            if sheet.item is not None and sheet.mark(sheet.item) is None:
                key = f"{settings.pair} {self.interlude.block} {self.form.name} {sheet.item.name}"
                rng = np.random.default_rng([settings.seed, zlib.crc32(key.encode())])
                self._moved(sheet.place(int(rng.integers(self.form.scale.marks))))
            self._accept()
            if not settings.headless:
                return

    def _save(self) -> None:
        """Writes the answers that changed.

        Raises:
            OSError: they cannot be written.
        """
        settings = self.game.settings
        study = str(settings.session_settings().get("study_plan", ""))
        consent = ",".join(player.consent for player in self.game.players if player.consent)
        block, form = self.interlude.block, self.form.name
        for item, value, seconds in self.sheet.changed():
            answer = Answer(study, settings.pair, block, form, item, value, seconds, self._source, consent)
            self.game.interludes.answers.add(answer)

    def draw(self, canvas: Canvas, fraction: float) -> None:
        """Draws the page."""
        sheet, scale = self.sheet, self.form.scale
        rows = [
            QuestionRow(item.title, item.text, item.labels, sheet.mark(item), number == sheet.row)
            for number, item in enumerate(sheet.items)
        ]
        view = QuestionsView(
            title=self.form.title,
            instruction=self.form.instruction,
            rows=rows,
            marks=scale.marks,
            first_number=scale.low if scale.step == 1 and scale.marks <= 11 else None,
            button="done" if sheet.on_last_page else "next page",
            button_selected=sheet.item is None,
            position=f"part {self.interlude.block} of {self.game.interludes.blocks}, {sheet.position}",
            hint=self.game.roster.hint(("a", "Enter or E", "next"), ("b", "Backspace or Q", "back")),
        )
        draw_questions(canvas, view)
        if self._quit_menu is not None:
            canvas.dim()
            lines = [Line("All answers so far are saved; the same command goes on here.", 26)]
            draw_dialog(canvas, self._quit_menu.title, lines, self._quit_menu.labels, self._quit_menu.cursor, YELLOW)
