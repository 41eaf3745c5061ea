"""Dialogues above the world: menus, banners, the count-down, the help, a line of text to write."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from copolicy.dataset.task import TABLE
from copolicy.dataset.task_spec import TIMEOUT, TaskSpec

from .canvas import WORLD, Canvas
from .palette import FLOOR, GREEN, INK, MUTED, PANEL, SKY, TEXT, VERMILION, YELLOW, Colour, mix

_OUTCOMES = {
    "goal": "Goal!",
    "collision_obstacle": "Obstacle hit",
    "collision_wall": "Wall hit",
    "timeout": "Time is up",
}
_MIDDLE = WORLD[1] + WORLD[3] / 2
_ROW = 46
_CONTROL = re.compile(r"\{(\w+)\}")
_STRIP = (370, 664, 460, 92)  # below the world, between the players' panels
STRIP_ROWS = 2
"""Rows of `draw_strip_menu`."""


def outcome_text(reason: str) -> str:
    """How an episode ended, in words."""
    return _OUTCOMES.get(reason, reason.replace("_", " "))


def outcome_colour(spec: TaskSpec, reason: str) -> Colour:
    """The colour of an end: a success, a time-out, another end of the world, or one that the world did not make."""
    if reason == TIMEOUT:
        return YELLOW
    return GREEN if reason in spec.successes else VERMILION if reason in spec.reasons else MUTED


class _Labels(Protocol):
    """What is printed on a gamepad, see `inputs.gamepads.Labels`."""

    def either(self, *controls: str) -> str: ...


HELP = (
    ("", "gamepad", "keyboard"),
    ("move the {}", "left stick or d-pad", "W A S D   and   arrows"),
    ("choose, start", "{a}", "Enter, E or Space"),
    ("back", "{b}", "Backspace, Q or right Shift"),
    ("pause and menu", "{start} {back}", "Esc or P"),
    ("keep", "{a}", "K"),
    ("redo now", "{x}", "R"),
    ("discard, with a reason", "{y}", "X"),
    ("add a note", "{leftshoulder}", "N"),
    ("undo the last keep", "{rightshoulder}", "U"),
    ("swap seats (lobby, before a start)", "in the menu", "Tab"),
    ("this help", "", "F1 or H"),
    ("full screen, sound", "", "F11, M"),
)
"""What to do (`{}` stands for the task), how on a gamepad (`{a}` for what is printed there), how on the keyboard."""


@dataclass(frozen=True)
class Line:
    """One line of a dialogue."""

    text: str
    size: float = 28
    colour: Colour = TEXT


def draw_dialog(
    canvas: Canvas,
    title: str,
    lines: Sequence[Line] = (),
    items: Sequence[str] = (),
    cursor: int = 0,
    colour: Colour = TEXT,
    width: float = 620,
    hint: str = "",
    middle: float = 600,
) -> None:
    """A box in the world, `middle` its place from left to right: a title, some lines, and a menu with a cursor."""
    height = 100 + sum(line.size + 12 for line in lines) + _ROW * len(items) + (34 if hint else 0) + 12 * bool(items)
    x, y = middle - width / 2, _MIDDLE - height / 2
    canvas.box(x, y, width, height, edge=colour)
    canvas.text(title, (middle, y + 46), 52, colour, "center", width - 60)
    y += 88
    for line in lines:
        canvas.text(line.text, (middle, y + line.size / 2), line.size, line.colour, "center", width - 50)
        y += line.size + 12
    y += 8
    for index, item in enumerate(items):
        chosen = index == cursor
        if chosen:
            canvas.box(x + 40, y, width - 80, _ROW - 6, mix(PANEL, SKY, 0.30), SKY)
        canvas.text(item, (middle, y + 20), 30, TEXT if chosen else MUTED, "center", width - 110)
        y += _ROW
    if hint:
        canvas.text(hint, (middle, y + 14), 22, MUTED, "center", width - 40)


def draw_strip_menu(canvas: Canvas, items: Sequence[str], cursor: int, hint: str, colour: Colour = MUTED) -> None:
    """A menu below the world, which hides nothing of it; its entries run down one column after the other."""
    x, y, width, height = _STRIP
    canvas.box(x, y, width, height)
    canvas.text(hint, (x + width / 2, y + 15), 22, colour, "center", width - 24)
    columns = -(-len(items) // STRIP_ROWS)
    cell = (width - 16) / columns
    for index, item in enumerate(items):
        column, row = divmod(index, STRIP_ROWS)
        left, top = x + 8 + column * cell, y + 28 + 30 * row
        chosen = index == cursor
        if chosen:
            canvas.box(left + 2, top, cell - 4, 28, mix(PANEL, SKY, 0.30), SKY)
        canvas.text(item, (left + cell / 2, top + 15), 23, TEXT if chosen else MUTED, "center", cell - 16)


def draw_countdown(canvas: Canvas, number: str, share: float) -> None:
    """A large number below the world; `share` in [0, 1] of its second is over."""
    y = _STRIP[1] + _STRIP[3] / 2
    with canvas.patch(600, y, 48) as patch:
        centre = canvas.point(600, y)
        patch.circle(SKY, centre, 44 * canvas.scale)
        patch.circle(PANEL, centre, (40 - 7 * share) * canvas.scale)
    canvas.text(number, (600, y + 2), 76 if len(number) == 1 else 54, TEXT, "center")


def draw_entry(canvas: Canvas, title: str, text: str) -> None:
    """A line that is being written."""
    draw_dialog(canvas, title, [Line(" ", 44)], hint="Enter: done      Esc: leave it", width=820)
    canvas.box(220, _MIDDLE - 24, 760, 52, FLOOR)
    canvas.text(f"{text}|", (236, _MIDDLE + 2), 32, INK, "midleft", 730)


def draw_help(canvas: Canvas, pads: Sequence[_Labels] = (), task: str = TABLE) -> None:
    """All commands of a session of a task, by what is printed on the gamepads in hand, and by keys."""
    canvas.dim()
    canvas.box(110, 80, 980, 600)
    canvas.text("Help", (600, 118), 46, TEXT, "center")
    y = 158
    for what, pad, keys in HELP:
        head = not what
        canvas.text(what.format(task), (150, y), 28, TEXT, max_width=430)
        controls = _CONTROL.findall(pad)
        if controls:
            pad = " / ".join(filter(None, (labels.either(*controls) for labels in pads))) or "-"
        canvas.text(pad, (610, y), 28, SKY if head else TEXT, max_width=190)
        canvas.text(keys, (820, y), 28, SKY if head else TEXT, max_width=250)
        y += 39


def draw_toast(canvas: Canvas, text: str) -> None:
    """A short message in the bar above the world."""
    canvas.box(410, 5, 600, 48, edge=YELLOW)
    canvas.text(text, (710, 30), 27, TEXT, "center", 575)
