"""Dialogues above the world: menus, banners, the count-down, the help, a line of text to write."""

from collections.abc import Sequence
from dataclasses import dataclass

from .canvas import WORLD, Canvas
from .palette import FLOOR, GREEN, INK, MUTED, PANEL, SKY, TEXT, VERMILION, YELLOW, Colour, mix

OUTCOME_COLOURS: dict[str, Colour] = {
    "goal": GREEN,
    "collision_obstacle": VERMILION,
    "collision_wall": VERMILION,
    "timeout": YELLOW,
}
OUTCOME_TEXTS = {
    "goal": "Goal!",
    "collision_obstacle": "Obstacle hit",
    "collision_wall": "Wall hit",
    "timeout": "Time is up",
}
_MIDDLE = WORLD[1] + WORLD[3] / 2
_ROW = 46

HELP = (
    ("", "joystick", "keyboard"),
    ("move the table", "left stick", "W A S D   and   arrows"),
    ("choose, start", "A", "Enter, E or Space"),
    ("back", "B", "Backspace, Q or right Shift"),
    ("pause and menu", "Start or Back", "Esc or P"),
    ("keep", "A", "K"),
    ("redo now", "X", "R"),
    ("discard, with a reason", "Y", "X"),
    ("add a note", "left shoulder", "N"),
    ("undo the last keep", "right shoulder", "U"),
    ("swap seats (lobby, before a start)", "in the menu", "Tab"),
    ("this help", "", "F1 or H"),
    ("full screen, sound", "", "F11, M"),
)


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


def draw_countdown(canvas: Canvas, number: str, share: float) -> None:
    """A large number above the obstacles; `share` in [0, 1] of its second is over."""
    y = WORLD[1] + 76
    with canvas.patch(600, y, 76) as patch:
        centre = canvas.point(600, y)
        patch.circle(SKY, centre, 68 * canvas.scale)
        patch.circle(PANEL, centre, (62 - 10 * share) * canvas.scale)
    canvas.text(number, (600, y), 110 if len(number) == 1 else 76, TEXT, "center")


def draw_entry(canvas: Canvas, title: str, text: str) -> None:
    """A line that is being written."""
    draw_dialog(canvas, title, [Line(" ", 44)], hint="Enter: done      Esc: leave it", width=820)
    canvas.box(220, _MIDDLE - 24, 760, 52, FLOOR)
    canvas.text(f"{text}|", (236, _MIDDLE + 2), 32, INK, "midleft", 730)


def draw_help(canvas: Canvas) -> None:
    """All commands, from the pads and from the keyboard."""
    canvas.dim()
    canvas.box(110, 80, 980, 600)
    canvas.text("Help", (600, 118), 46, TEXT, "center")
    y = 158
    for what, pad, keys in HELP:
        head = not what
        canvas.text(what, (150, y), 28, TEXT, max_width=430)
        canvas.text(pad, (610, y), 28, SKY if head else TEXT, max_width=190)
        canvas.text(keys, (820, y), 28, SKY if head else TEXT, max_width=250)
        y += 39


def draw_toast(canvas: Canvas, text: str) -> None:
    """A short message above the world."""
    canvas.box(260, 68, 680, 50, edge=YELLOW)
    canvas.text(text, (600, 93), 28, TEXT, "center", 650)
