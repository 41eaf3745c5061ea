"""What a session is, as the command line says it."""

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

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
PILOT_KINDS = ("joystick", "keyboard", "scripted", "replay", "policy")


@dataclass(frozen=True)
class PilotSpec:
    """Who plays: `joystick`, `keyboard`, `scripted[:PAIR]`, `replay:FILE` or `policy:CKPT`."""

    kind: str
    detail: str = ""

    @classmethod
    def parse(cls, text: str, task: str = TABLE) -> "PilotSpec":
        """
        Args:
            task: name of the task that they play.

        Raises:
            UnknownNameError: another kind, or another simulated pair.
            InvalidValueError: a file or a checkpoint is missing, or there is something too much.
            CopolicyError: a simulated player of a task that has none.
        """
        kind, _, detail = text.partition(":")
        if kind not in PILOT_KINDS:
            raise UnknownNameError("pilot", kind, PILOT_KINDS)
        if kind == "scripted":
            detail = pair_name(get_task(task), detail)
        elif kind in ("replay", "policy") and not detail:
            raise InvalidValueError("pilots", f"{kind}:{'FILE' if kind == 'replay' else 'CKPT'}", text)
        elif kind in ("joystick", "keyboard") and detail:
            raise InvalidValueError("pilots", kind, text)
        return cls(kind, detail)

    @property
    def is_person(self) -> bool:
        """A person plays."""
        return self.kind in ("joystick", "keyboard")


@dataclass(frozen=True)
class PlaySettings:
    """What a session is.

    Attributes:
        task: its name.
        pair: pseudonym of the pair; its players are `PAIR-a` and `PAIR-b`.
        out: folder of all sessions.
        pilots: of player a and b; None for what is plugged in.
        maps: set of maps, a file of maps, or one of its splits as `FILE#split`.
        orientations: each map with four start orientations.
        episodes: to be kept.
        practice: episodes to try things out before.
        seed: of the schedule and of simulated players.
        swap_seats: the players change seats in the middle.
        consents: record id of each player's consent, or an empty text.
        license: of the recordings, by the identifier of the Hub, or an empty text.
        angular_limit: bound on the angular acceleration, rad/s^2; the task's own if None.
        headless: no window; nobody is asked anything.
        countdown_s: before each episode.
    """

    pair: str
    out: Path
    pilots: tuple[PilotSpec, PilotSpec] | None = None
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

    def __post_init__(self):
        for name, text in (("pair", self.pair), *((f"consent-{k}", one) for k, one in enumerate(self.consents) if one)):
            if not _NAME.fullmatch(text):
                raise InvalidValueError(name, "letters, digits, '.', '_' or '-' (an id, no name of a person)", text)
        for name, value, least in (
            ("episodes", self.episodes, 1),
            ("practice", self.practice, 0),
            ("seed", self.seed, 0),
        ):
            if value < least:
                raise InvalidValueError(name, f"at least {least}", value)
        get_task(self.task).required_outline  # noqa: B018 (what is played is seen)
        self.map_configs()
        if self.window is not None and not all(320 <= side <= 16384 for side in self.window):
            raise InvalidValueError("window", "WxH of at least 320x320", "{}x{}".format(*self.window))
        if not 0 <= self.countdown_s <= 60:
            raise InvalidValueError("countdown", "seconds from 0 to 60", self.countdown_s)
        checked_licence(self.license)
        self.physics  # noqa: B018  (checks the limit)

    @property
    def physics(self) -> Any:
        """Settings of the world."""
        task = get_task(self.task)
        usual = task.settings_type()
        return usual if self.angular_limit is None else with_angular_limit(task, usual, self.angular_limit)

    @functools.cached_property
    def scenarios(self) -> ScenarioSet:
        """The maps to choose from, as a set."""
        task = get_task(self.task)
        chosen = task.scenario_set(self.maps)
        return task.turned(chosen) if self.orientations else chosen

    def map_configs(self) -> tuple[Any, ...]:
        """The maps to choose from."""
        return self.scenarios.scenarios

    def fixed(self) -> dict:
        """What must not change within a session."""
        bound = angular_limit_of(self.physics)
        return {
            **({} if self.task == TABLE else {"task": self.task}),
            "maps": self.scenarios.label,
            **({"maps_digest": self.scenarios.digest} if self.scenarios.from_file else {}),
            "orientations": self.orientations,
            "seed": self.seed,
            **({} if bound is None else {"angular_limit": bound}),
        }
