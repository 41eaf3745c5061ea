"""Drawing of the lobby: a summary of the session, and a panel for each player."""

from collections.abc import Sequence
from dataclasses import dataclass

from .canvas import Canvas
from .palette import GREEN, MUTED, PANEL, PANEL_EDGE, SEATS, SKY, TEXT, VERMILION, YELLOW, mix
from .patch import Point


@dataclass
class LobbyPanel:
    """The content of one player's panel.

    Attributes:
        seat: of the player, 0 robot, 1 human.
        player: pseudonym.
        prompt: instruction for the player.
        device: name of the device; empty until the player has joined.
        stick: raw deflection, x and y in [-1, 1]; None without a device.
        steering: label of the control that steers.
        force: after calibration and dead zone, x and y in [-1, 1].
        dead_zone: proportion of full deflection.
        items: of the player's menu.
        cursor: index of the selected item.
        ready: the player has confirmed.
        progress: of a set-up, in [0, 1]; None if none is in progress.
        notice: a fault of the device, or why one could not join.
    """

    seat: int
    player: str
    prompt: str
    device: str = ""
    stick: Point | None = None
    steering: str = "stick"
    force: Point = (0.0, 0.0)
    dead_zone: float = 0.0
    items: Sequence[str] = ()
    cursor: int = -1
    ready: bool = False
    progress: float | None = None
    notice: str = ""


def draw_lobby(
    canvas: Canvas, title: str, summary: Sequence[str], panels: Sequence[LobbyPanel], may_exchange_seats: bool = True
) -> None:
    """Draws the lobby: a title, lines that summarise the session, and the players' panels."""
    canvas.text(title, (600, 44), 54, TEXT, "center", 1140)
    for row, line in enumerate(summary):
        canvas.text(line, (600, 90 + 32 * row), 27, MUTED, "center", 1140)
    for panel in panels:
        _draw_panel(canvas, panel, 20 + 590 * panel.seat)
    swap = "Tab: swap seats      " if may_exchange_seats else ""
    canvas.text(f"F1 or H: help      {swap}Esc: quit", (600, 738), 22, MUTED, "center")


def _draw_panel(canvas: Canvas, panel: LobbyPanel, x: float) -> None:
    colour = GREEN if panel.ready else SEATS[panel.seat] if panel.device else PANEL_EDGE
    canvas.box(x, 186, 570, 530, edge=colour)
    canvas.seat_mark(panel.seat, x + 52, 238, 34)
    seat = ("triangle: robot seat", "circle: human seat")[panel.seat]
    canvas.text(panel.player, (x + 104, 208), 40, max_width=440)
    canvas.text(seat, (x + 104, 246), 25, MUTED, max_width=440)
    if not panel.device:
        canvas.text(panel.prompt, (x + 285, 450), 38, YELLOW, "center", 530)
        for row, line in enumerate(panel.notice.split(": ", 1)):
            canvas.text(line, (x + 285, 510 + 30 * row), 25, VERMILION, "center", 540)
        return
    canvas.text(panel.device, (x + 285, 286), 28, SKY, "center", 530)
    canvas.text(panel.notice, (x + 285, 309), 24, YELLOW, "center", 540)
    if panel.stick is not None:
        canvas.stick(x + 150, 440, 98, panel.stick, panel.seat, panel.dead_zone)
        canvas.text(panel.steering, (x + 150, 552), 22, MUTED, "midtop")
        canvas.text(f"force  {panel.force[0]:+.2f}  {panel.force[1]:+.2f}", (x + 150, 576), 24, TEXT, "midtop")
    if panel.progress is not None:
        canvas.text(panel.prompt, (x + 285, 640), 32, YELLOW, "center", 530)
        canvas.bar(x + 60, 672, 450, 16, panel.progress, SKY)
        return
    menu_x, width = (x + 284, 262) if panel.stick is not None else (x + 115, 340)
    for row, item in enumerate(panel.items):
        y = 322 + 36 * row
        selected = row == panel.cursor
        if selected:
            canvas.box(menu_x, y, width, 35, mix(PANEL, SKY, 0.30), SKY)
        canvas.text(item, (menu_x + 14, y + 18), 25, TEXT if selected else MUTED, "midleft", width - 24)
    if panel.ready:
        canvas.box(x + 60, 654, 450, 50, mix(PANEL, GREEN, 0.45), GREEN)
        canvas.text("ready", (x + 285, 679), 36, TEXT, "center")
    else:
        canvas.text(panel.prompt, (x + 285, 686), 27, YELLOW, "center", 530)
