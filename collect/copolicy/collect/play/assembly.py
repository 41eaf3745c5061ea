"""Everything that a session consists of, opened in order, each part named on the screen while it is loaded."""

import logging
from contextlib import ExitStack

from copolicy.dataset.exceptions import RunError
from copolicy.dataset.task import get_task

from ..inputs import HALVES, CalibrationStore, MappingStore, Pads, user_config_folder
from ..recording.recover import recover
from ..screen.window import Window
from ..session import CollectionLock, SessionFolder
from ..ticker import MonotonicClock
from .application import Application
from .game import Game
from .loading import Loading
from .phase import To
from .player import Player, default_pilots, make_players, say_other_physics
from .roster import Roster
from .settings import PlaySettings
from .sounds import Sounds


def assemble(
    settings: PlaySettings, window: Window | None, loading: Loading, stack: ExitStack, clock: MonotonicClock | None
) -> Application:
    """Opens folder, devices and players, and puts them together.

    Args:
        window: to play in.
        loading: what runs what takes long.
        stack: closes everything.
        clock: what the session follows; None for the machine's.

    Raises:
        CopolicyError: files or devices that cannot be used, or a folder that another tool collects into.
    """
    clock = clock or MonotonicClock()
    # The first world of a process takes long enough for a press of a button to be missed.
    task = get_task(settings.task)
    task.make_world(settings.map_configs()[0], settings.physics)
    lock = _lock(settings)
    stack.callback(lock.close)
    recoveries = loading.run("recordings that broke off", lambda: recover(settings.out))
    recovered = [one for one in recoveries if one.status == "recovered"]
    for one in recovered:
        logging.info("recovered %s: %d steps", one.output.name if one.output else one.source.name, one.steps)
    config = settings.config_folder or user_config_folder()
    store = CalibrationStore(config)
    pads = Pads(MappingStore(config))
    pilots = settings.pilots or default_pilots(sum(bool(pad.steerings) for pad in pads))
    policies = [pilot.detail for pilot in pilots if pilot.kind == "policy"]
    what = f"the policy {policies[0]}, with torch and LeRobot" if policies else "the players"
    players = loading.run(what, lambda: make_players(settings.pair, pilots, settings.consents, clock, task))
    for player in players:
        stack.callback(player.agent.close)
    say_other_physics(players, settings.physics, task)
    folder = loading.run("what was played before", lambda: _folder(settings))
    sounds = Sounds(settings.mute or settings.headless)
    stack.callback(sounds.close)
    game = Game(settings, Roster(players, pads, store, folder.journal, clock), folder, sounds, clock)
    if recovered:
        game.say(f"{len(recovered)} recording(s) of a broken-off run recovered")
    if settings.headless:
        _join_by_order(game)
    first = To.READY if settings.headless else To.LOBBY
    return Application(game, window, first if not game.finished else To.FINISHED)


def _lock(settings: PlaySettings) -> CollectionLock:
    try:
        return CollectionLock(settings.out)
    except OSError as error:
        raise RunError(f"{settings.out}: expected a folder to write to, found: {error.strerror}") from None


def _folder(settings: PlaySettings) -> SessionFolder:
    return SessionFolder(
        settings.out, settings.pair, settings.fixed(), settings.episodes, settings.new_session, settings.task
    )


def _join_by_order(game: Game) -> None:
    """Without a lobby, devices are given out in the order in which they are there."""
    for device in (*game.roster.pads, *HALVES.values()):
        game.roster.give(device)
    missing: list[Player] = game.roster.missing()
    if any(player.spec.kind == "keyboard" for player in game.players):
        raise RunError("pilots: expected no keyboard with --headless, found one: keys need a window")
    if missing:
        raise RunError(f"{missing[0].player_id}: expected a joystick, found {len(game.roster.pads)} for both players")
