"""Dialogs over the world: menus, the count-down, the help, text fields and short messages."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

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
    """Returns the text for a termination reason."""
    return _OUTCOMES.get(reason, reason.replace("_", " "))


def outcome_colour(spec: TaskSpec, reason: str) -> Colour:
    """Returns the colour for a termination reason: of success, time-out, another end of the world, or a stop."""
    if reason == TIMEOUT:
        return YELLOW
    return GREEN if reason in spec.successes else VERMILION if reason in spec.reasons else MUTED


class _Labels(Protocol):
    """The labels printed on a gamepad, see `inputs.mapping.Labels`."""

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
    ("swap seats (before an episode)", "in the menu", "Tab"),
    ("this help", "", "F1 or H"),
    ("full screen, sound", "", "F11, M"),
)
"""Action (`{}` is what moves), gamepad control (`{a}` is the label printed on it) and key."""


@dataclass(frozen=True)
class Line:
    """One line of a dialog."""

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
    """Draws a box over the world, centred at x = `middle`: a title, lines of text, a menu with a cursor and a hint."""
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
        selected = index == cursor
        if selected:
            canvas.box(x + 40, y, width - 80, _ROW - 6, mix(PANEL, SKY, 0.30), SKY)
        canvas.text(item, (middle, y + 20), 30, TEXT if selected else MUTED, "center", width - 110)
        y += _ROW
    if hint:
        canvas.text(hint, (middle, y + 14), 22, MUTED, "center", width - 40)


def draw_strip_menu(canvas: Canvas, items: Sequence[str], cursor: int, hint: str, colour: Colour = MUTED) -> None:
    """Draws a menu below the world; its items fill one column after the other."""
    x, y, width, height = _STRIP
    canvas.box(x, y, width, height)
    canvas.text(hint, (x + width / 2, y + 15), 22, colour, "center", width - 24)
    columns = -(-len(items) // STRIP_ROWS)
    cell = (width - 16) / columns
    for index, item in enumerate(items):
        column, row = divmod(index, STRIP_ROWS)
        left, top = x + 8 + column * cell, y + 28 + 30 * row
        selected = index == cursor
        if selected:
            canvas.box(left + 2, top, cell - 4, 28, mix(PANEL, SKY, 0.30), SKY)
        canvas.text(item, (left + cell / 2, top + 15), 23, TEXT if selected else MUTED, "center", cell - 16)


def draw_countdown(canvas: Canvas, number: str, fraction: float) -> None:
    """Draws a large number below the world; `fraction` of its second has passed, in [0, 1]."""
    y = _STRIP[1] + _STRIP[3] / 2
    with canvas.patch(600, y, 48) as patch:
        centre = canvas.point(600, y)
        patch.circle(SKY, centre, 44 * canvas.scale)
        patch.circle(PANEL, centre, (40 - 7 * fraction) * canvas.scale)
    canvas.text(number, (600, y + 2), 76 if len(number) == 1 else 54, TEXT, "center")


def draw_entry(canvas: Canvas, title: str, text: str) -> None:
    """Draws a text field."""
    draw_dialog(canvas, title, [Line(" ", 44)], hint="Enter: save      Esc: cancel", width=820)
    canvas.box(220, _MIDDLE - 24, 760, 52, FLOOR)
    canvas.text(f"{text}|", (236, _MIDDLE + 2), 32, INK, "midleft", 730)


def draw_help(canvas: Canvas, gamepads: Sequence[_Labels] = (), noun: str = "body") -> None:
    """Draws all commands of a session, by the labels of the gamepads in use and by keys; `noun` is what moves."""
    canvas.dim()
    canvas.box(110, 80, 980, 600)
    canvas.text("Help", (600, 118), 46, TEXT, "center")
    y = 158
    for action, control, keys in HELP:
        colour = TEXT if action else SKY
        canvas.text(action.format(noun), (150, y), 28, TEXT, max_width=430)
        names = _CONTROL.findall(control)
        if names:
            control = " / ".join(filter(None, (labels.either(*names) for labels in gamepads))) or "-"
        canvas.text(control, (610, y), 28, colour, max_width=190)
        canvas.text(keys, (820, y), 28, colour, max_width=250)
        y += 39


def draw_toast(canvas: Canvas, text: str) -> None:
    """Draws a short message in the bar above the world."""
    canvas.box(410, 5, 600, 48, edge=YELLOW)
    canvas.text(text, (710, 30), 27, TEXT, "center", 575)
