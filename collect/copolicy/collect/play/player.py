"""The two players of a session: who they are, what they hold, what they agreed to."""

import logging
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.physics_text import physics_summary
from copolicy.dataset.task import PairTask, get_task

from ..agents import PersonAgent, PolicyAgent, ReplayAgent, ScriptedAgent, load_policy
from ..inputs import HALVES, KeyboardHalf, Pad
from ..rollout import Agent
from .settings import PilotSpec


@dataclass
class Player:
    """One of the pair.

    Attributes:
        index: 0 for player a, 1 for player b.
        player_id: pseudonym.
        consent: record id, empty where there is none.
        ready: has agreed in the lobby.
    """

    index: int
    player_id: str
    spec: PilotSpec
    agent: Agent
    consent: str
    ready: bool

    @property
    def person(self) -> PersonAgent | None:
        """A person; None for anything else."""
        return self.agent if isinstance(self.agent, PersonAgent) else None

    @property
    def device(self) -> Pad | KeyboardHalf | None:
        """What a person holds."""
        return self.person.device if self.person else None

    @property
    def missing(self) -> bool:
        """A person without a device."""
        return self.person is not None and self.person.device is None

    @property
    def device_id(self) -> int | str | None:
        """What presses of this player come from."""
        if isinstance(self.device, Pad):
            return self.device.instance_id
        return self.device.name if self.device else None

    @property
    def label(self) -> str:
        """The player and what they hold, for the screen."""
        if isinstance(self.device, Pad):
            return self.device.name
        if self.device is not None:
            return f"keys {self.device.hint.split(',')[0]}"
        return "joins with any button" if self.person else self.agent.name

    def wants(self, device: Pad | KeyboardHalf) -> bool:
        """This player could join with a device."""
        return self.missing and (self.spec.kind == "joystick") == isinstance(device, Pad)

    def describe(self) -> dict[str, str]:
        """For the recording: what was held and how it was set; nothing that identifies a person or a machine."""
        about = {"player": self.player_id, "controller": self.agent.name}
        if isinstance(self.device, Pad) and self.person:
            pad, settings = self.device, self.person.calibration
            about |= {"device": pad.name, "guid": pad.guid, "instance_id": str(pad.instance_id)}
            about |= {key: str(value) for key, value in settings.to_json().items()}
            about |= {"steering": pad.steering(settings).label, "mapping": pad.mapping.source}
        elif self.device:
            about["device"] = f"keyboard, {self.device.name}"
        return about


def default_pilots(pads: int) -> tuple[PilotSpec, PilotSpec]:
    """Joysticks as far as there are any, the keyboard beside them."""
    kinds = ["joystick"] * min(2, pads) + ["keyboard"] * 2
    return PilotSpec(kinds[0]), PilotSpec(kinds[1])


def make_players(
    pair: str,
    specs: Sequence[PilotSpec],
    consents: Sequence[str],
    clock: Callable[[], int] = time.monotonic_ns,
    task: PairTask | None = None,
) -> tuple[Player, Player]:
    """The players, with files and checkpoints loaded.

    Args:
        clock: of the session, ns.
        task: that they play; the table if None.

    Raises:
        InvalidValueError: a person, a recording or a policy that cannot act in the task.
        FileFormatError: a recording or a checkpoint cannot be used.
        MissingExtraError: a policy is to play and torch or LeRobot is not installed.
    """
    players = []
    for index, spec in enumerate(specs):
        agent = _agent(spec, task or get_task(), clock)
        consent = consents[index] if spec.is_person else ""
        player_id = f"{pair}-{'ab'[index]}"
        players.append(Player(index, player_id, spec, agent, consent, ready=not spec.is_person))
    return players[0], players[1]


def replayed_map(players: Iterable[Player]) -> Any | None:
    """The map on which a replayed recording was made, None where nothing is replayed.

    Raises:
        InvalidValueError: two recordings of different maps.
    """
    maps = {one.agent.scenario for one in players if isinstance(one.agent, ReplayAgent)}
    if len(maps) > 1:
        raise InvalidValueError("pilots", "replays of one map", sorted(config.digest for config in maps))
    return maps.pop() if maps else None


def say_other_physics(players: Iterable[Player], physics: Any, task: PairTask | None = None) -> None:
    """Actions of an earlier recording lead elsewhere under other settings."""
    for player in players:
        if isinstance(player.agent, ReplayAgent):
            recorded = replace(player.agent.settings, step_limit=physics.step_limit)
            if recorded != physics:
                words = (player.agent.name, physics_summary(recorded, task), physics_summary(physics, task))
                logging.warning("warning: %s was recorded with %s, this session has %s", *words)


def keyboard_half(name: int | str) -> KeyboardHalf | None:
    """The half of the keyboard that a press came from."""
    return HALVES.get(name) if isinstance(name, str) else None


def _agent(spec: PilotSpec, task: PairTask, clock: Callable[[], int]) -> Agent:
    match spec.kind:
        case "scripted":
            return ScriptedAgent.from_pair(spec.detail, task)
        case "replay":
            return ReplayAgent(Path(spec.detail), task)
        case "policy":
            return PolicyAgent(load_policy(spec.detail), task, real_time=True, clock=clock)
        case kind:
            return PersonAgent(kind, clock, task.spec.action)
