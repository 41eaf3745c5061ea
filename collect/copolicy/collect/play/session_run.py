"""`copolicy-collect play`: opens everything in order, runs the session, closes everything in order."""

import gc
import logging
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from copolicy.dataset.exceptions import RunError

from ..inputs import HALVES, CalibrationStore, Pads, user_config_folder
from ..recover import recover
from ..sdl import pygame
from ..session import CollectionLock, SessionFolder
from .application import Application
from .game import Game
from .phase import To
from .player import default_pilots, make_players, say_other_physics
from .roster import Roster
from .settings import PlaySettings
from .sounds import Sounds
from .window import Window, open_without_window


def play(settings: PlaySettings) -> dict:
    """Runs a session until it is complete or somebody ends it.

    Returns:
        What was recorded, JSON-able.

    Raises:
        CopolicyError: settings, files or devices that cannot be used, a folder that another tool collects into, or a
            disk that cannot be written to where nobody can be asked.
    """
    with prepared(settings) as application:
        with stopped_by_signals(application.game):
            application.run()
        return application.summary()


@contextmanager
def prepared(settings: PlaySettings) -> Iterator[Application]:
    """Opens folder, devices, window and players; closes them however the block is left."""
    with ExitStack() as stack:
        lock = _lock(settings)
        stack.callback(lock.close)
        recovered = [one for one in recover(settings.out) if one.status == "recovered"]
        for one in recovered:
            logging.info("recovered %s: %d steps", one.output.name if one.output else one.source.name, one.steps)
        store = CalibrationStore(settings.config_folder or user_config_folder())
        window = None
        if settings.headless:
            open_without_window()
        else:
            window = Window(settings.window, settings.fullscreen)
        stack.callback(_close_pygame)
        pads = Pads()
        players = make_players(settings.pair, settings.pilots or default_pilots(len(pads)), settings.consents)
        for player in players:
            stack.callback(player.controller.close)
        say_other_physics(players, settings.physics)
        fixed = settings.fixed()
        folder = SessionFolder(settings.out, settings.pair, fixed, settings.episodes, settings.new_session)
        sounds = Sounds(settings.mute or settings.headless)
        stack.callback(sounds.close)
        game = Game(settings, Roster(players, pads, store, folder.journal), folder, sounds)
        if recovered:
            game.say(f"{len(recovered)} recording(s) of a broken-off run recovered")
        if settings.headless:
            _join_by_order(game)
        first = To.READY if settings.headless else To.LOBBY
        gc.collect()
        gc.freeze()
        stack.callback(gc.unfreeze)
        stack.callback(gc.enable)
        # A thread that plans must not hold the loop for Python's usual 5 ms.
        stack.callback(sys.setswitchinterval, sys.getswitchinterval())
        sys.setswitchinterval(0.0005)
        application = Application(game, window, first if not game.finished else To.FINISHED)
        yield application
        folder.journal("end", reason=game.stop or "end")


def _lock(settings: PlaySettings) -> CollectionLock:
    try:
        return CollectionLock(settings.out)
    except OSError as error:
        raise RunError(f"{settings.out}: expected a folder to write to, found: {error.strerror}") from None


def _join_by_order(game: Game) -> None:
    """Without a lobby, devices are given out in the order in which they are there."""
    for device in (*game.roster.pads, *HALVES.values()):
        game.roster.give(device)
    missing = game.roster.missing()
    if any(player.spec.kind == "keyboard" for player in game.players):
        raise RunError("pilots: expected no keyboard with --headless, found one: keys need a window")
    if missing:
        raise RunError(f"{missing[0].player_id}: expected a joystick, found {len(game.roster.pads)} for both players")


@contextmanager
def stopped_by_signals(game: Game) -> Iterator[None]:
    """SIGTERM and Ctrl-C end the session in order: the running episode is completed up to its last step."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: object) -> None:
        game.stop = game.stop or signal.Signals(number).name

    before = {number: signal.signal(number, stop) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _close_pygame() -> None:
    pygame.joystick.quit()
    pygame.display.quit()
