"""The plan of a human study: who carries with which robot on which start, in which order, and the key to it all."""

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, UnknownNameError
from copolicy.dataset.files.json_file import read_json
from copolicy.dataset.scenarios import ScenarioName
from copolicy.dataset.task import get_task
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics

_VERSION = 1
_WHAT = "a plan of copolicy-eval human plan"


@dataclass(frozen=True)
class Robot:
    """One of the robots that are compared.

    Attributes:
        checkpoint: as it was named, a path or `pretrained`.
        weights_sha256: digest of the weights that the study is about.
    """

    name: str
    checkpoint: str
    weights_sha256: str

    @classmethod
    def of(cls, name: str, checkpoint: str) -> "Robot":
        """
        Raises:
            FileFormatError: no such checkpoint.
        """
        return cls(name, checkpoint, weights_digest(checkpoint))


@dataclass(frozen=True)
class PlannedTrial:
    """One episode.

    Attributes:
        code: what the screen and the recording say of the robot, and nothing more.
        block: from 1; the robot is the same within a block.
        robot: name of the robot.
        configuration: index of the start.
    """

    code: str
    block: int
    robot: str
    configuration: int


@dataclass(frozen=True)
class StudyPlan:
    """All that is decided before the first person comes.

    Attributes:
        plan_id: digest of everything else; recordings carry it.
        robots: that are compared.
        configurations: starts that are shared out among participants.
        trials: of each participant, in order.
        settings: of the policies, as `--num-inference-steps` gives them.
    """

    plan_id: str
    maps: str
    robots: tuple[Robot, ...]
    configurations: tuple[MapConfig, ...]
    trials: dict[str, tuple[PlannedTrial, ...]]
    seed: int = 0
    actions_per_plan: int = 1
    step_limit: int = 2000
    angular_acceleration_limit: float = math.pi / 2
    settings: dict[str, Any] = field(default_factory=dict)

    @property
    def physics(self) -> Physics:
        """Settings of the world."""
        return Physics(self.angular_acceleration_limit, self.step_limit)

    @property
    def map_set(self) -> dict[str, dict[str, str]]:
        """Name, version and digest of a file that the starts are from, as settings of a result."""
        name = self.configurations[0].named
        if name is None:
            return {}
        return {"map_set": {"name": self.maps, "version": name.version, "digest": name.digest, "from": "file"}}

    def of(self, participant: str) -> tuple[PlannedTrial, ...]:
        """The trials of a participant.

        Raises:
            UnknownNameError: nobody of that name is planned.
        """
        if participant not in self.trials:
            raise UnknownNameError("participant", participant, self.trials)
        return self.trials[participant]

    def to_json(self) -> dict[str, Any]:
        """The file of the plan."""
        content = asdict(self)
        content["configurations"] = [
            {**_columns(config), **json.loads(config.to_json())} for config in self.configurations
        ]
        return {
            "study_plan": _VERSION,
            "note": "This file tells which robot is which: whoever runs the sessions should not read it.",
            **content,
        }

    @classmethod
    def read(cls, path: Path) -> "StudyPlan":
        """
        Raises:
            FileFormatError: no such file, no plan, or one that was changed since it was made.
        """
        content = read_json(path, dict[str, Any], _WHAT)
        try:
            if content["study_plan"] != _VERSION:
                raise FileFormatError(path, f"{_WHAT}, version {_VERSION}", f"version {content['study_plan']}")
            fields = {name: content[name] for name in cls.__dataclass_fields__}
            fields["robots"] = tuple(Robot(**one) for one in content["robots"])
            fields["configurations"] = tuple(_configuration(one) for one in content["configurations"])
            fields["trials"] = {
                name: tuple(PlannedTrial(**one) for one in trials) for name, trials in content["trials"].items()
            }
            plan = cls(**fields)
            digest = _digest(plan)
        except (KeyError, TypeError, AttributeError, ValueError, InvalidValueError) as error:
            raise FileFormatError(path, _WHAT, f"none: {type(error).__name__} {error}") from None
        if plan.plan_id != digest:
            raise FileFormatError(path, f"the plan {plan.plan_id} as it was made", f"a changed one, {digest}")
        return plan


def make_plan(
    robots: Sequence[Robot],
    maps: str,
    configurations: Sequence[MapConfig],
    participants: int,
    episodes_per_robot: int,
    seed: int,
    **settings: Any,
) -> StudyPlan:
    """Lays out a within-subject study.

    Every participant carries with every robot on the same `episodes_per_robot` starts, in one block for each robot,
    so that robots are compared within a person on equal starts and a person can judge each robot by itself. Robots
    are ordered by a Williams design over participants; starts are dealt out in turn and shuffled in every block.

    Args:
        settings: further fields of the plan.

    Raises:
        InvalidValueError: fewer than two robots, equal names, no participant, or more starts than there are.
    """
    names = [robot.name for robot in robots]
    if len(names) < 2 or len(set(names)) < len(names):
        raise InvalidValueError("CKPT", "at least two robots of different names", names)
    if participants < 1:
        raise InvalidValueError("--participants", "at least 1", participants)
    if not 1 <= episodes_per_robot <= len(configurations):
        raise InvalidValueError("--episodes-per-robot", f"1 to {len(configurations)}", episodes_per_robot)
    rng = np.random.default_rng(seed)
    shuffled = [names[k] for k in rng.permutation(len(names))]
    square = williams_square(len(names))
    trials: dict[str, tuple[PlannedTrial, ...]] = {}
    for person in range(participants):
        first = person * episodes_per_robot
        own = [(first + k) % len(configurations) for k in range(episodes_per_robot)]
        planned: list[PlannedTrial] = []
        for block, robot in enumerate(square[person % len(square)], 1):
            for place in rng.permutation(len(own)):
                code = f"B{block}T{len(planned) + 1:02d}"
                planned.append(PlannedTrial(code, block, shuffled[robot], own[int(place)]))
        trials[f"P{person + 1:02d}"] = tuple(planned)
    plan = StudyPlan("", maps, tuple(robots), tuple(configurations), trials, seed, **settings)
    return StudyPlan(**{**vars(plan), "plan_id": _digest(plan)})


def weights_digest(checkpoint: str) -> str:
    """The sha256 of a checkpoint's weights, without loading it.

    Raises:
        FileFormatError: no such checkpoint.
    """
    return hashlib.sha256((checkpoint_folder(checkpoint) / "model.safetensors").read_bytes()).hexdigest()


def _columns(config: MapConfig) -> dict[str, Any]:
    """How the file of the plan names a start; of a map from a file all that recordings say of it."""
    name = get_task().name_of(config)
    return {"map_id": name.scenario} if config.named is None else name.columns


def _configuration(entry: dict[str, Any]) -> MapConfig:
    config = MapConfig.from_json(json.dumps(entry))
    if "map_set_digest" not in entry:
        return config
    return replace(config, named=ScenarioName(*(entry[name] for name in ScenarioName("", "").columns)))


def _digest(plan: StudyPlan) -> str:
    content: dict[str, Any] = {**asdict(plan), "plan_id": ""}
    for one in content["configurations"]:
        for later in ("obstacle_sizes", "named"):  # of later versions: plans without them keep their digest
            if not one[later]:
                del one[later]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:8]


def williams_square(count: int) -> list[list[int]]:
    """Williams' design (1949): rows are orders of `count` conditions, one for each participant in turn.

    With an even number, one square of `count` rows; with an odd one, that square and its mirror image.
    """
    first = [0]
    low, high = 1, count - 1
    while len(first) < count:
        first.append(low if len(first) % 2 else high)
        low, high = (low + 1, high) if len(first) % 2 == 0 else (low, high - 1)
    square = [[(condition + row) % count for condition in first] for row in range(count)]
    return square if count % 2 == 0 or count == 1 else square + [row[::-1] for row in square]
