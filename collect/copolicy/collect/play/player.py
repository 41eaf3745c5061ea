"""The two players of a session: id, agent, device and consent."""

import logging
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.settings_text import describe_settings
from copolicy.dataset.task import PairTask, get_task

from ..agents import PersonAgent, PolicyAgent, ReplayAgent, ScriptedAgent, load_policy
from ..inputs import Gamepad, KeyboardHalf
from ..rollout import Agent
from .settings import PlayerSpec


@dataclass
class SeatedPlayer:
    """One player of the pair.

    Attributes:
        index: 0 for player a, 1 for player b.
        player_id: pseudonym.
        spec: how the player is controlled.
        agent: that acts for the player.
        consent: id of the consent record; empty if there is none.
        ready: the player has confirmed in the lobby.
    """

    index: int
    player_id: str
    spec: PlayerSpec
    agent: Agent
    consent: str
    ready: bool

    @property
    def person(self) -> PersonAgent | None:
        """The agent if it is a person, else None."""
        return self.agent if isinstance(self.agent, PersonAgent) else None

    @property
    def device(self) -> Gamepad | KeyboardHalf | None:
        """The device of a person, or None."""
        return self.person.device if self.person else None

    @property
    def lacks_device(self) -> bool:
        """The player is a person without a device."""
        return self.person is not None and self.person.device is None

    @property
    def device_id(self) -> int | str | None:
        """The id of the player's device in a `Press`, or None."""
        if isinstance(self.device, Gamepad):
            return self.device.instance_id
        return self.device.name if self.device else None

    @property
    def label(self) -> str:
        """The player's device or agent, for the screen."""
        if isinstance(self.device, Gamepad):
            return self.device.name
        if self.device is not None:
            return f"keys {self.device.hint.split(',')[0]}"
        return "press any button to join" if self.person else self.agent.name

    def can_use(self, device: Gamepad | KeyboardHalf) -> bool:
        """Whether this player needs a device of this kind."""
        return self.lacks_device and (self.spec.kind == "joystick") == isinstance(device, Gamepad)

    def describe(self) -> dict[str, str]:
        """Returns device and calibration for the recording; nothing that identifies a person or a machine."""
        entries = {"player": self.player_id, "controller": self.agent.name}
        if isinstance(self.device, Gamepad) and self.person:
            gamepad, calibration = self.device, self.person.calibration
            entries |= {"device": gamepad.name, "guid": gamepad.guid, "instance_id": str(gamepad.instance_id)}
            entries |= {key: str(value) for key, value in calibration.to_json().items()}
            entries |= {"steering": gamepad.steering(calibration).label, "mapping": gamepad.mapping.source}
        elif self.device:
            entries["device"] = f"keyboard, {self.device.name}"
        return entries


def default_players(gamepads: int) -> tuple[PlayerSpec, PlayerSpec]:
    """Returns gamepads for as many players as there are gamepads, and the keyboard for the others."""
    kinds = ["joystick"] * min(2, gamepads) + ["keyboard"] * 2
    return PlayerSpec(kinds[0]), PlayerSpec(kinds[1])


def make_players(
    pair: str,
    specs: Sequence[PlayerSpec],
    consents: Sequence[str],
    clock: Callable[[], int] = time.monotonic_ns,
    task: PairTask | None = None,
) -> tuple[SeatedPlayer, SeatedPlayer]:
    """Makes the players and loads their recordings and checkpoints.

    Args:
        pair: pseudonym of the pair.
        specs: of player a and b.
        consents: ids of their consent records; empty if there is none.
        clock: of the session, ns.
        task: that they play; the table if None.

    Raises:
        InvalidValueError: a person, a recording or a policy cannot act in the task.
        FileFormatError: a recording or a checkpoint cannot be used.
        MissingExtraError: torch or LeRobot is not installed, and a player is a policy.
    """
    players = []
    for index, spec in enumerate(specs):
        agent = _agent(spec, task or get_task(), clock)
        consent = consents[index] if spec.is_person else ""
        player_id = f"{pair}-{'ab'[index]}"
        players.append(SeatedPlayer(index, player_id, spec, agent, consent, ready=not spec.is_person))
    return players[0], players[1]


def replayed_scenario(players: Iterable[SeatedPlayer]) -> Any | None:
    """Returns the scenario of the replayed recordings, or None if nothing is replayed.

    Raises:
        InvalidValueError: two recordings have different scenarios.
    """
    scenarios = {player.agent.scenario for player in players if isinstance(player.agent, ReplayAgent)}
    if len(scenarios) > 1:
        raise InvalidValueError("--players", "replays of one map", sorted(scenario.digest for scenario in scenarios))
    return scenarios.pop() if scenarios else None


def warn_other_settings(players: Iterable[SeatedPlayer], settings: Any, task: PairTask | None = None) -> None:
    """Warns if a replayed recording has other world settings, under which its actions lead to other states."""
    for player in players:
        if isinstance(player.agent, ReplayAgent):
            recorded = replace(player.agent.settings, step_limit=settings.step_limit)
            if recorded != settings:
                summaries = (describe_settings(recorded, task), describe_settings(settings, task))
                logging.warning("warning: %s was recorded with %s, this session has %s", player.agent.name, *summaries)


def _agent(spec: PlayerSpec, task: PairTask, clock: Callable[[], int]) -> Agent:
    match spec.kind:
        case "scripted":
            return ScriptedAgent.from_pair(spec.detail, task)
        case "replay":
            return ReplayAgent(Path(spec.detail), task)
        case "policy":
            return PolicyAgent(load_policy(spec.detail), task, real_time=True, clock=clock)
        case kind:
            return PersonAgent(kind, clock, task.spec.action)
