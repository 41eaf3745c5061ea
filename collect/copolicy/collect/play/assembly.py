"""Loads the parts of a session in order and builds the application; the screen names the part being loaded."""

import logging
from contextlib import ExitStack
from pathlib import Path

from copolicy.dataset.exceptions import RunError
from copolicy.dataset.task import get_task

from ..inputs import HALVES, CalibrationStore, Gamepads, MappingStore, user_config_folder
from ..recording.recover import recover
from ..screen.window import Window
from ..session import CollectionLock, SessionFolder
from ..ticker import MonotonicClock
from .application import Application
from .game import Game
from .interludes import Interludes
from .loading import Loading
from .phase import NextPhase, before_next_episode
from .player import default_players, make_players, warn_other_settings
from .roster import Roster
from .settings import PlaySettings
from .sounds import Sounds


def assemble(
    settings: PlaySettings, window: Window | None, loading: Loading, stack: ExitStack, clock: MonotonicClock | None
) -> Application:
    """Opens folder, devices and players, and builds the application.

    Args:
        settings: of the session.
        window: to play in; None for a headless session.
        loading: runs the slow parts.
        stack: closes all parts when it is closed.
        clock: of the session; None for the machine's.

    Raises:
        CopolicyError: files or devices cannot be used, or another tool collects into the folder.
    """
    clock = clock or MonotonicClock()
    # The first world of a process is slow to make; made later, a button press could be missed meanwhile.
    task = get_task(settings.task)
    task.make_world(settings.scenarios[0], settings.world_settings)
    try:
        stack.callback(CollectionLock(settings.out).close)
    except OSError as error:
        raise RunError(f"{settings.out}: expected a folder to write to, found: {error.strerror}") from None
    recoveries = loading.run("interrupted recordings", lambda: recover(settings.out))
    recovered = [recovery for recovery in recoveries if recovery.status == "recovered"]
    for recovery in recovered:
        logging.info("recovered %s: %d steps", (recovery.output or recovery.source).name, recovery.steps)
    config_folder = settings.config_folder or user_config_folder()
    store = CalibrationStore(config_folder)
    gamepads = Gamepads(MappingStore(config_folder))
    specs = settings.players or default_players(sum(bool(gamepad.steering_options) for gamepad in gamepads))
    policies = [spec.detail for spec in specs if spec.kind == "policy"]
    name = f"the policy {policies[0]}, with torch and LeRobot" if policies else "the players"
    players = loading.run(name, lambda: make_players(settings.pair, specs, settings.consents, clock, task))
    for player in players:
        stack.callback(player.agent.close)
    warn_other_settings(players, settings.world_settings, task)
    keys = (settings.out, settings.pair, settings.session_settings(), settings.episodes, settings.new_session)

    def has_open_questions(path: Path) -> bool:
        questions = Interludes(path, settings.interludes()).open_questionnaire(settings.episodes)
        return questions is not None and bool(settings.answered_by())

    opened = (settings.task, has_open_questions, settings.once)
    folder = loading.run("earlier episodes", lambda: SessionFolder(*keys, *opened))
    sounds = Sounds(settings.mute or settings.headless)
    stack.callback(sounds.close)
    game = Game(settings, Roster(players, gamepads, store, folder.journal, clock), folder, sounds, clock)
    if recovered:
        game.show_message(f"{len(recovered)} interrupted recording(s) recovered")
    if settings.headless:
        _assign_devices(game)
    following = before_next_episode(game)
    return Application(
        game, window, following if settings.headless or following is NextPhase.FINISHED else NextPhase.LOBBY
    )


def _assign_devices(game: Game) -> None:
    """Assigns the devices in order, for a session without a lobby."""
    for device in (*game.roster.gamepads, *HALVES.values()):
        game.roster.assign(device)
    if any(player.spec.kind == "keyboard" for player in game.players):
        raise RunError("--players: expected no keyboard with --headless, found one: keys need a window")
    if missing := [player.player_id for player in game.roster.without_device()]:
        raise RunError(f"{missing[0]}: expected a gamepad, found {len(game.roster.gamepads)} for both players")
