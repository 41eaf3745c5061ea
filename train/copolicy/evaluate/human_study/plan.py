"""The plan of a human study: who carries with which robot on which start, in which order, and the key to it all."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
from copolicy.collect.angular_limit import LIMIT_SETTING
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, UnknownNameError
from copolicy.dataset.files.json_file import read_json
from copolicy.dataset.scenarios import ScenarioName
from copolicy.dataset.task import TABLE, PairTask, get_task

from ..study_flags import usual_settings

_VERSION = 1
_WHAT = "a plan of copolicy-eval human plan"
_WORLD = ("step_limit", LIMIT_SETTING, "physics")


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
        world: its settings, as `stated_settings` gives them; the usual ones where there are none.
        settings: of the policies, as `--num-inference-steps` gives them.
        task_name: of what is done together.
    """

    plan_id: str
    maps: str
    robots: tuple[Robot, ...]
    configurations: tuple[Any, ...]
    trials: dict[str, tuple[PlannedTrial, ...]]
    seed: int = 0
    actions_per_plan: int = 1
    world: dict[str, Any] = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)
    task_name: str = TABLE

    @property
    def task(self) -> PairTask:
        """What is done together."""
        return get_task(self.task_name)

    @property
    def physics(self) -> Any:
        """Settings of the world."""
        stated = {name: value for name, value in self.world.items() if name != "physics"}
        return replace(usual_settings(self.task), **self.world.get("physics", stated))

    @property
    def map_set(self) -> dict[str, dict[str, str]]:
        """Name, version and digest of a file that the starts are from, as settings of a result."""
        name = self.task.name_of(self.configurations[0])
        if not name.digest:
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
        configurations = [{**_columns(self.task, one), **json.loads(one.to_json())} for one in self.configurations]
        return {
            "study_plan": _VERSION,
            "note": "This file tells which robot is which: whoever runs the sessions should not read it.",
            **_content(self, configurations),
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
            content["task_name"] = content.pop("task", TABLE)
            content["world"] = {name: content[name] for name in _WORLD if name in content}
            fields = {name: content[name] for name in cls.__dataclass_fields__}
            task = get_task(content["task_name"])
            fields["robots"] = tuple(Robot(**one) for one in content["robots"])
            fields["configurations"] = tuple(_configuration(task, one) for one in content["configurations"])
            fields["trials"] = {
                name: tuple(PlannedTrial(**one) for one in trials) for name, trials in content["trials"].items()
            }
            plan = cls(**fields)
            digest = _digest(plan)
            plan.physics  # noqa: B018 (checks the settings)
        except (KeyError, TypeError, AttributeError, ValueError, InvalidValueError) as error:
            raise FileFormatError(path, _WHAT, f"none: {type(error).__name__} {error}") from None
        if plan.plan_id != digest:
            raise FileFormatError(path, f"the plan {plan.plan_id} as it was made", f"a changed one, {digest}")
        return plan


def make_plan(
    robots: Sequence[Robot],
    maps: str,
    configurations: Sequence[Any],
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


def _columns(task: PairTask, config: Any) -> dict[str, Any]:
    """How the file of the plan names a start; of a map from a file all that recordings say of it."""
    name = task.name_of(config)
    return name.columns if name.digest else {"map_id": name.scenario}


def _configuration(task: PairTask, entry: dict[str, Any]) -> Any:
    columns = ScenarioName("", "").columns
    config = task.scenario_of_json(json.dumps({name: value for name, value in entry.items() if name not in columns}))
    if "map_set_digest" not in entry or not hasattr(config, "named"):
        return config
    return replace(config, named=ScenarioName(*(entry[name] for name in columns)))


def _content(plan: StudyPlan, configurations: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The fields of a plan as its file has them; one that names no task is of the table."""
    content: dict[str, Any] = {}
    for name, value in asdict(replace(plan, configurations=())).items():
        content |= value if name == "world" else {name: value}
    content["configurations"] = list(configurations)
    if (task := content.pop("task_name")) != TABLE:
        content["task"] = task
    return content


def _digest(plan: StudyPlan) -> str:
    configurations = [
        asdict(one) if is_dataclass(type(one)) else json.loads(one.to_json()) for one in plan.configurations
    ]
    for one in configurations:
        for later in ("obstacle_sizes", "named"):  # of later versions: plans without them keep their digest
            if later in one and not one[later]:
                del one[later]
    content = {**_content(plan, configurations), "plan_id": ""}
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
