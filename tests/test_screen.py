"""What is drawn, checked where it must be seen."""

import math

import numpy as np
import pytest

from copolicy.collect.inputs import Command, Press
from copolicy.collect.play.menu import BACK, Menu
from copolicy.collect.screen import SIZE, Canvas, draw_text, palette, text_size
from copolicy.collect.screen.dialogs import (
    HELP,
    Line,
    draw_countdown,
    draw_dialog,
    draw_help,
    draw_strip_menu,
    draw_toast,
)
from copolicy.collect.screen.hud import Hud, SeatStatus, draw_hud
from copolicy.collect.screen.outline_view import letterbox
from copolicy.collect.sdl import pygame
from copolicy.dataset.outline import interpolate_pose
from copolicy.tasks.table.artist.table_view import TableView
from copolicy.tasks.table.map_config import MapConfig

MAP = MapConfig(start=(240.0, 300.0, 0.0), goal=(960.0, 180.0), obstacles=((600.0, 450.0),))


def _surface(size=(1200, 600)):
    return pygame.Surface(size, depth=32)


def _colour(surface, point):
    return tuple(surface.get_at((round(point[0]), round(point[1]))))[:3]


def _close(colour, expected):
    return max(abs(a - b) for a, b in zip(colour, expected, strict=True)) < 12


@pytest.mark.parametrize("size", [(1200, 600), (600, 300), (2400, 1200), (800, 800), (1500, 400)])
def test_everything_stands_where_it_is_at_any_size(size):
    surface, view = _surface(size), TableView(MAP)
    area = surface.get_rect()
    rect = view.draw(surface, area, (300.0, 200.0, 0.0))
    assert rect == letterbox(area, (1200, 600))
    assert rect.width / rect.height == pytest.approx(2.0, abs=0.01)
    assert rect.center == area.center
    for point, colour in (
        ((300.0 - 78.0, 200.0), palette.SEATS[1]),
        ((300.0 + 75.5, 200.0 + 6), palette.SEATS[0]),
        ((300.0, 193.0), palette.WOOD),
        ((960.0 - 40.0, 180.0 - 40.0), palette.mix(palette.GREEN, palette.FLOOR, 0.62)),
        ((1100.0, 525.0), palette.FLOOR),
    ):
        drawn = _colour(surface, view.to_screen(point))
        assert _close(drawn, colour), (point, drawn, colour)
    assert sum(_colour(surface, view.to_screen((600.0, 450.0)))) < 320, "an obstacle is dark"


def test_the_table_turns_counter_clockwise_on_screen():
    surface, view = _surface(), TableView(MAP)
    view.draw(surface, surface.get_rect(), (300.0, 300.0, math.pi / 2))
    assert _close(_colour(surface, (300 + 6, 300 - 75)), palette.SEATS[0])
    assert _close(_colour(surface, (300, 300 + 78)), palette.SEATS[1])


def test_an_arrow_points_where_the_force_goes_and_grows_with_it():
    def painted(force):
        surface, view = _surface(), TableView(MAP)
        view.draw(surface, surface.get_rect(), (400.0, 200.0, 0.0))
        before = pygame.surfarray.array3d(surface).astype(int)
        view.draw(surface, surface.get_rect(), (400.0, 200.0, 0.0), (0.0, 0.0, *force))
        return np.argwhere(np.abs(pygame.surfarray.array3d(surface) - before).sum(axis=2) > 40)

    full, half = painted((-1.0, 0.0)), painted((-0.5, 0.0))
    assert full[:, 0].min() < 400 - 78 - 90
    assert half[:, 0].min() > full[:, 0].min() + 30
    assert painted((0.0, 1.0))[:, 1].max() > 200 + 90
    assert len(painted((0.02, 0.0))) == 0


def test_a_table_moves_by_less_than_a_pixel():
    surface, view = _surface(), TableView(MAP)
    pictures = []
    for x in (400.0, 400.34, 400.67):
        view.draw(surface, surface.get_rect(), (x, 200.0, 0.3))
        pictures.append(pygame.surfarray.array3d(surface).astype(int))
    assert np.abs(pictures[1] - pictures[0]).sum() > 0
    assert np.abs(pictures[2] - pictures[1]).sum() > 0


def test_a_trail_shows_the_ways_of_both_ends():
    surface, view = _surface(), TableView(MAP)
    trail = [(300.0 + k, 300.0, 0.0) for k in range(0, 300, 3)]
    view.draw(surface, surface.get_rect(), trail[-1], trail=trail)
    assert _close(_colour(surface, (300 - 78 + 50, 300)), palette.mix(palette.SEATS[1], palette.FLOOR, 0.55))
    assert _close(_colour(surface, (300 + 75 + 50, 306)), palette.mix(palette.SEATS[0], palette.FLOOR, 0.55))


def test_nothing_is_drawn_beside_the_world():
    surface, view = _surface((1200, 800)), TableView(MAP)
    view.draw(surface, surface.get_rect(), (60.0, 20.0, 0.0), (0.0, -1.0, 0.0, -1.0))
    assert {_colour(surface, (x, 50)) for x in range(0, 1200, 7)} == {(0, 0, 0)}


@pytest.mark.parametrize(("start", "end", "middle"), [(0.1, 0.3, 0.2), (6.2, 0.1, 6.2 + (0.1 - 6.2 + 2 * math.pi) / 2)])
def test_a_pose_between_two_turns_the_shorter_way(start, end, middle):
    x, y, theta = interpolate_pose((0.0, 10.0, start), (2.0, 20.0, end), 0.5)
    assert (x, y) == (1.0, 15.0)
    assert theta == pytest.approx(middle)


def test_long_text_is_made_to_fit():
    surface = _surface((400, 100))
    assert draw_text(surface, "short", (10, 10), 30).size == text_size("short", 30)
    assert draw_text(surface, "a rather long line of text " * 3, (10, 10), 30, max_width=150).width <= 150


@pytest.mark.parametrize("width", [520, 400, 330, 300])
def test_text_is_not_cut_that_fits_in_smaller_type(width):
    hint = "A or Cross: keep   X or Square: redo   Y or Triangle: discard"
    drawn = draw_text(_surface((600, 100)), hint, (10, 10), 26, max_width=width)
    fitting = [size for size in range(13, 27) if text_size(hint, size)[0] <= width]
    assert drawn.size == text_size(hint, max(fitting))


@pytest.mark.parametrize("size", [(1200, 760), (400, 320), (700, 900), (2400, 1520)])
def test_dialogues_stay_in_the_window(size):
    surface = _surface(size)
    canvas = Canvas(surface)
    seats = (SeatStatus("a pad with a rather long name", (0.5, 0.5)), SeatStatus("keys", lost=True))
    hud = Hud("P01   episode 1 of 36", 0.5, 12.3, 33.3, -12.0, seats, -0.8, late_ticks=3)
    for draw in (
        lambda: draw_hud(canvas, hud),
        lambda: draw_dialog(canvas, "A title", [Line("a line of text " * 9)], ["one", "two"] * 3, 1, hint="how"),
        lambda: draw_countdown(canvas, "3", 0.2),
        lambda: draw_strip_menu(canvas, ["one", "two"] * 3, 1, "how to choose " * 9),
        lambda: draw_help(canvas),
        lambda: draw_toast(canvas, "a message"),
    ):
        canvas.clear()
        draw()
        picture = pygame.surfarray.array3d(surface)
        assert (picture != picture[0, 0]).any()
    left, top = canvas.point(0, 0)
    right, bottom = canvas.point(*SIZE)
    assert min(left, top) >= -1e-6
    assert right <= size[0] + 1e-6
    assert bottom <= size[1] + 1e-6


def test_the_help_names_every_key_of_the_verdict():
    text = " ".join(word for row in HELP for word in row)
    assert all(word in text for word in ("keep", "redo", "discard", "note", "undo", "pause", "swap"))


def test_the_seats_differ_for_people_who_see_few_colours():
    # Luminance alone (no hue at all) tells them apart, and goal from obstacle.
    def luminance(colour):
        return sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), colour, strict=True))

    assert abs(luminance(palette.BLUE) - luminance(palette.ORANGE)) > 60
    assert abs(luminance(palette.GREEN) - luminance(palette.OBSTACLE)) > 50


def test_a_menu_goes_round_and_tells_the_choice():
    menu = Menu("", [("one", "1"), ("two", "2"), ("three", "3")])
    assert menu.handle(Press(Command.UP, 0)) is None
    assert menu.handle(Press(Command.ACCEPT, 0)) == "3"
    assert menu.handle(Press(Command.DOWN, 0)) is None
    assert menu.handle(Press(Command.ACCEPT, 0)) == "1"
    assert menu.handle(Press(Command.BACK, 0)) == BACK
