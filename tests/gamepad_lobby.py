"""The game with virtual gamepads in its players' hands, step by step."""

from contextlib import contextmanager

from play_session import on_short_map, settings

from copolicy.collect.play.session_run import prepared
from copolicy.collect.screen import Canvas
from copolicy.collect.sdl import pygame
from copolicy.dataset.recording.reader import read_episode


class Hands:
    """Presses and ticks by turns, without waiting for the clock."""

    def __init__(self, application):
        self.application = application
        self.game = application.game

    @property
    def phase(self):
        return type(self.application.phase).__name__

    def ticks(self, count=1):
        for _ in range(count):
            assert self.application._tick(self.game.ticker.tick())

    def press(self, button, *gamepads):
        """Several gamepads pressed at once are one that is listed twice, or two people."""
        for down in (True, False):
            for gamepad in gamepads:
                gamepad.button(button, down)
            self.ticks(4)

    def panel(self, player=0):
        players = self.game.seats()
        seat = [seated.index for seated in players].index(player)
        return self.application.phase._panel(seat, players[seat])

    def screen(self):
        canvas = Canvas(pygame.Surface((1200, 760), depth=32))
        canvas.clear()
        self.application.phase.draw(canvas, 1.0)
        return canvas.surface

    def start(self, *gamepads, button=0):
        """From the lobby, where all have joined, to the first step."""
        for gamepad in gamepads:
            self.press(button, gamepad)
        self.ticks(20)
        assert self.phase == "Ready"
        self.press(button, gamepads[0])
        self.ticks(3)
        assert self.phase == "Running"


@contextmanager
def lobby(tmp_path, **changes):
    with prepared(settings(tmp_path, **changes)) as application:
        on_short_map(application)
        application.phase.enter()
        yield Hands(application)
        application.game.end_trial("quit")


def flags(path):
    """Of a recording; how fast the test ticks is not looked at."""
    return set(read_episode(path).meta.quality_flags.split(",")) - {"interrupted", "slow_loop", ""}


def devices(hands):
    return [player.device.name if player.device else None for player in hands.game.players]
