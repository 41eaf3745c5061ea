"""The settings of a session."""

import functools
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.publication.licences import checked_licence
from copolicy.dataset.scenarios import ScenarioSet
from copolicy.dataset.task import TABLE, get_task

from ..agents.simulated_players import pair_name
from ..angular_limit import angular_limit_of, with_angular_limit
from .interludes import Interlude

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
PLAYER_KINDS = ("joystick", "keyboard", "scripted", "replay", "policy")


@dataclass(frozen=True)
class PlayerSpec:
    """How a player is controlled: `joystick`, `keyboard`, `scripted[:PAIR]`, `replay:FILE` or `policy:CKPT`."""

    kind: str
    detail: str = ""

    @classmethod
    def parse(cls, text: str, task: str = TABLE) -> "PlayerSpec":
        """
        Args:
            text: the kind, and its detail after a colon.
            task: name of the task.

        Raises:
            UnknownNameError: the kind or the scripted pair is unknown.
            InvalidValueError: a file or a checkpoint is missing, or the kind takes no detail.
            CopolicyError: the task has no scripted players.
        """
        kind, _, detail = text.partition(":")
        if kind not in PLAYER_KINDS:
            raise UnknownNameError("player", kind, PLAYER_KINDS)
        if kind == "scripted":
            detail = pair_name(get_task(task), detail)
        elif kind in ("replay", "policy") and not detail:
            raise InvalidValueError("player", f"{kind}:{'FILE' if kind == 'replay' else 'CKPT'}", text)
        elif kind in ("joystick", "keyboard") and detail:
            raise InvalidValueError("player", kind, text)
        return cls(kind, detail)

    @property
    def is_person(self) -> bool:
        """The player is a person."""
        return self.kind in ("joystick", "keyboard")


@dataclass(frozen=True)
class PlaySettings:
    """The settings of a session.

    Attributes:
        pair: pseudonym of the pair; its players are `PAIR-a` and `PAIR-b`.
        out: folder of all sessions.
        players: how player a and b are controlled; None for the connected devices.
        maps: a named set of scenarios, a scenario file, or one of its splits as `FILE#split`.
        orientations: use each scenario with four start orientations.
        episodes: number of episodes to keep.
        practice: number of practice episodes before them.
        seed: of the schedule and of scripted players.
        swap_seats: change seats in the middle; None: only if both players are people.
        consents: id of each player's consent record; empty if there is none.
        license: of the recordings, as an identifier of the Hub; empty if none.
        angular_limit: bound on the angular acceleration, rad/s^2; the task's own if None.
        headless: without a window and without prompts.
        config_folder: folder of calibrations and mappings; the user's own if None.
        countdown_s: seconds before each episode.
        task: its name.
        may_exchange_seats: the players may exchange seats by hand.
        once: a finished session is not followed by another one, other than by `new_session`.
    """

    pair: str
    out: Path
    players: tuple[PlayerSpec, PlayerSpec] | None = None
    maps: str = "training"
    orientations: bool = False
    episodes: int = 36
    practice: int = 0
    seed: int = 0
    swap_seats: bool | None = None
    consents: tuple[str, str] = ("", "")
    license: str = ""
    angular_limit: float | None = None
    headless: bool = False
    fullscreen: bool = False
    window: tuple[int, int] | None = None
    mute: bool = False
    config_folder: Path | None = None
    new_session: bool = False
    countdown_s: float = 3.0
    task: str = TABLE
    may_exchange_seats: bool = True
    once: bool = False

    def __post_init__(self) -> None:
        ids = {"pair": self.pair, **{f"consent-{k}": text for k, text in enumerate(self.consents) if text}}
        for name, text in ids.items():
            if not _NAME.fullmatch(text):
                raise InvalidValueError(name, "letters, digits, '.', '_' or '-' (an id, no name of a person)", text)
        for name, value, least in (
            ("episodes", self.episodes, 1),
            ("practice", self.practice, 0),
            ("seed", self.seed, 0),
        ):
            if value < least:
                raise InvalidValueError(name, f"at least {least}", value)
        get_task(self.task).required_outline  # noqa: B018 (raises without one: it is drawn)
        self.scenarios  # noqa: B018 (raises for an invalid set)
        if self.window is not None and not all(320 <= side <= 16384 for side in self.window):
            raise InvalidValueError("window", "WxH of at least 320x320", "{}x{}".format(*self.window))
        if not 0 <= self.countdown_s <= 60:
            raise InvalidValueError("countdown", "seconds from 0 to 60", self.countdown_s)
        checked_licence(self.license)
        self.world_settings  # noqa: B018 (raises for an invalid limit)

    @property
    def world_settings(self) -> Any:
        """Settings of the world."""
        task = get_task(self.task)
        defaults = task.settings_type()
        return defaults if self.angular_limit is None else with_angular_limit(task, defaults, self.angular_limit)

    @functools.cached_property
    def scenario_set(self) -> ScenarioSet:
        """The set of scenarios to play."""
        task = get_task(self.task)
        scenarios = task.scenario_set(self.maps)
        return task.turned(scenarios) if self.orientations else scenarios

    @property
    def scenarios(self) -> tuple[Any, ...]:
        """The scenarios to play."""
        return self.scenario_set.scenarios

    def interludes(self) -> tuple[Interlude, ...]:
        """Questionnaires and breaks between the blocks of the session; none in an ordinary one."""
        return ()

    def answered_by(self) -> str:
        """Who answers questionnaires: `human`, `simulated`, or empty if a person has no window to read them in."""
        if not any(player.is_person for player in self.players or (PlayerSpec("keyboard"),)):
            return "simulated"
        return "" if self.headless else "human"

    def session_settings(self) -> dict[str, Any]:
        """Returns the settings that must not change within a session, JSON-able."""
        bound = angular_limit_of(self.world_settings)
        return {
            **({} if self.task == TABLE else {"task": self.task}),
            "maps": self.scenario_set.label,
            **({"maps_digest": self.scenario_set.digest} if self.scenario_set.from_file else {}),
            "orientations": self.orientations,
            "seed": self.seed,
            **({} if bound is None else {"angular_limit": bound}),
        }
