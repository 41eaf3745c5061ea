"""Drawing of a page of a questionnaire: items on the left, their scales on the right."""

from collections.abc import Sequence
from dataclasses import dataclass

from .canvas import SIZE, Canvas
from .palette import GREEN, INK, MUTED, PANEL, PANEL_EDGE, SKY, SURROUND, TEXT, YELLOW, mix
from .text import fitted_lines

_TOP, _ROW, _GAP = 116, 90, 4
_TEXT_X, _TEXT_WIDTH = 44, 540
_SCALE_X, _SCALE_WIDTH = 648, 470
_HEADING = 26  # of the heading of an item


@dataclass(frozen=True)
class QuestionRow:
    """One item.

    Attributes:
        labels: of the low and the high end.
        mark: index of the chosen mark; None without an answer.
        selected: the cursor is here.
    """

    title: str
    text: str
    labels: tuple[str, str]
    mark: int | None
    selected: bool


@dataclass(frozen=True)
class QuestionsView:
    """The content of a page.

    Attributes:
        marks: number of marks of each scale.
        first_number: number of the first mark, for a scale of few numbered marks; None for a line without numbers.
        button: label of the button below the items.
        position: what is answered so far.
        hint: keys and buttons.
    """

    title: str
    instruction: str
    rows: Sequence[QuestionRow]
    marks: int
    first_number: float | None
    button: str
    button_selected: bool
    position: str
    hint: str


def draw_questions(canvas: Canvas, view: QuestionsView) -> None:
    """Draws a page with at most six items."""
    canvas.text(view.title, (_TEXT_X, 40), 48, TEXT, "midleft", 600)
    size, lines = fitted_lines(view.instruction, 28, 1112, 2, canvas.scale)
    for number, line in enumerate(lines):
        canvas.text(line, (_TEXT_X, 76 + size * number), size, SKY)
    for number, row in enumerate(view.rows):
        _draw_row(canvas, row, view, _TOP + number * (_ROW + _GAP))
    y = _TOP + len(view.rows) * (_ROW + _GAP) + 6
    complete = all(row.mark is not None for row in view.rows)
    edge = SKY if view.button_selected else PANEL_EDGE
    canvas.box(480, y, 240, 42, mix(PANEL, SKY if view.button_selected else GREEN, 0.3 * complete), edge)
    canvas.text(view.position, (SIZE[0] - _TEXT_X, y + 22), 24, MUTED, "midright", 400)
    canvas.text(view.button, (600, y + 22), 30, TEXT if complete else MUTED, "center", 220)
    canvas.text(
        f"up, down: choose a line      left, right: move the mark      {view.hint}",
        (600, 742),
        22,
        MUTED,
        "center",
        1140,
    )


def _draw_row(canvas: Canvas, row: QuestionRow, view: QuestionsView, y: float) -> None:
    fill = mix(PANEL, SKY, 0.16) if row.selected else PANEL
    canvas.box(24, y, SIZE[0] - 48, _ROW, fill, SKY if row.selected else PANEL_EDGE)
    largest, most, heading = (24, 2, _HEADING) if row.title else (27, 3, 0)
    size, lines = fitted_lines(row.text, largest, _TEXT_WIDTH, most, canvas.scale)
    top = y + (_ROW - size * len(lines) - heading) / 2
    if row.title:
        canvas.text(row.title, (_TEXT_X, top + 11), 29, TEXT, "midleft", _TEXT_WIDTH)
    for number, line in enumerate(lines):
        middle = top + heading + size * (number + 0.5)
        canvas.text(line, (_TEXT_X, middle), size, MUTED if row.title else TEXT, "midleft", _TEXT_WIDTH)
    _draw_scale(canvas, row, view, y)


def _draw_scale(canvas: Canvas, row: QuestionRow, view: QuestionsView, y: float) -> None:
    middle = y + 34
    spacing = _SCALE_WIDTH / (view.marks - 1)
    with canvas.patch(_SCALE_X + _SCALE_WIDTH / 2, middle, _SCALE_WIDTH / 2 + 30) as patch:
        scale = canvas.scale
        patch.line(MUTED, canvas.point(_SCALE_X, middle), canvas.point(_SCALE_X + _SCALE_WIDTH, middle), 3 * scale)
        for mark in range(view.marks):
            x = _SCALE_X + mark * spacing
            if view.first_number is None:
                half = 13 if mark in (0, (view.marks - 1) / 2, view.marks - 1) else 8
                patch.line(MUTED, canvas.point(x, middle - half), canvas.point(x, middle + half), 2 * scale)
            else:
                patch.circle(MUTED, canvas.point(x, middle), 16 * scale)
                patch.circle(SURROUND, canvas.point(x, middle), 14 * scale)
        if row.mark is not None:
            x = _SCALE_X + row.mark * spacing
            patch.circle(INK, canvas.point(x, middle), 18 * scale)
            patch.circle(YELLOW, canvas.point(x, middle), 15 * scale)
    if view.first_number is not None:
        for mark in range(view.marks):
            colour = INK if mark == row.mark else MUTED
            number = f"{view.first_number + mark:g}"
            canvas.text(number, (_SCALE_X + mark * spacing, middle + 1), 24, colour, "center")
    low, high = row.labels
    canvas.text(low, (_SCALE_X - 16, y + 71), 23, MUTED, "midleft", _SCALE_WIDTH / 2)
    canvas.text(high, (_SCALE_X + _SCALE_WIDTH + 16, y + 71), 23, MUTED, "midright", _SCALE_WIDTH / 2)
