"""The plan of a human study: robots, starts, and the trials of each participant in order; read and written as JSON."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, is_dataclass, replace
from pathlib import Path
from typing import Any

from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
from copolicy.collect.agents.training_conditions import training_conditions
from copolicy.collect.angular_limit import LIMIT_SETTING
from copolicy.collect.questionnaire import Questionnaire
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, UnknownNameError
from copolicy.dataset.files.json_file import read_json
from copolicy.dataset.scenarios import ScenarioName
from copolicy.dataset.task import TABLE, PairTask, get_task
from copolicy.train.processor_files import processors_sha256

from ..study_flags import default_settings

_VERSION = 1
_EXPECTED = "a plan of copolicy-eval human plan"
_WORLD = ("step_limit", LIMIT_SETTING, "physics")


@dataclass(frozen=True)
class Robot:
    """One of the compared robots.

    Attributes:
        checkpoint: path of the checkpoint, or `pretrained`.
        weights_sha256: sha256 of its weights when the plan was made.
        method: name of the published method that it implements; empty if it is none.
        processors_sha256: sha256 of the files of its processors when the plan was made; empty in older plans.
    """

    name: str
    checkpoint: str
    weights_sha256: str
    method: str = ""
    processors_sha256: str = ""

    @classmethod
    def from_checkpoint(cls, name: str, checkpoint: str) -> "Robot":
        """
        Raises:
            FileFormatError: the checkpoint does not exist.
        """
        folder = checkpoint_folder(checkpoint)
        config = read_json(folder / "config.json", dict[str, Any], "the configuration of a policy")
        published = get_task(training_conditions(folder).task).studies.published
        method = next((method.name for method in published if method.is_of(config)), "")
        return cls(name, checkpoint, weights_digest(checkpoint), method, processors_sha256(folder))


@dataclass(frozen=True)
class PlannedTrial:
    """One planned episode.

    Attributes:
        code: the only name of the robot on the screen and in the recording.
        block: number of the block, from 1; the robot is the same within a block.
        robot: name of the robot.
        configuration: index of the start.
        front: set-up of the start, see `Studies.fronts`; empty in a plan without set-ups.
    """

    code: str
    block: int
    robot: str
    configuration: int
    front: str = ""


@dataclass(frozen=True)
class StudyPlan:
    """Everything that is fixed before the first session.

    Attributes:
        plan_id: digest of the other fields; recordings contain it.
        configurations: starts that are dealt to the participants.
        trials: trials of each participant, in order.
        world: settings of the world, from `recorded_settings`; defaults for those that are absent.
        settings: settings of the policies that flags override, such as `num_inference_steps`.
        questionnaires: asked after each block.
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
    questionnaires: tuple[Questionnaire, ...] = ()

    @property
    def task(self) -> PairTask:
        """The task of the study."""
        return get_task(self.task_name)

    @property
    def world_settings(self) -> Any:
        """Settings of the world."""
        flagged = {name: value for name, value in self.world.items() if name != "physics"}
        return replace(default_settings(self.task), **self.world.get("physics", flagged))

    @property
    def map_set(self) -> dict[str, dict[str, str]]:
        """The `map_set` entry of a result: name, version and digest of the scenario file of the starts, if any."""
        name = self.task.name_of(self.configurations[0])
        if not name.digest:
            return {}
        return {"map_set": {"name": self.maps, "version": name.version, "digest": name.digest, "from": "file"}}

    def trials_of(self, participant: str) -> tuple[PlannedTrial, ...]:
        """The trials of a participant.

        Raises:
            UnknownNameError: the plan has no such participant.
        """
        if participant not in self.trials:
            raise UnknownNameError("participant", participant, self.trials)
        return self.trials[participant]

    def to_json(self) -> dict[str, Any]:
        """The content of the plan's file."""
        configurations = [
            {**_columns(self.task, scenario), **json.loads(scenario.to_json())} for scenario in self.configurations
        ]
        return {
            "study_plan": _VERSION,
            "note": "This file tells which robot is which: whoever runs the sessions should not read it.",
            **_content(self, configurations),
        }

    def blocks_of(self, participant: str) -> dict[int, str]:
        """The robot of each block of a participant, in order."""
        return {trial.block: trial.robot for trial in self.trials_of(participant)}

    @property
    def fronts(self) -> tuple[str, ...]:
        """The set-ups of the plan, in the order of the task's; empty without."""
        used = {trial.front for trials in self.trials.values() for trial in trials}
        return tuple(front for front in self.task.studies.fronts if front in used)

    @classmethod
    def read(cls, path: Path) -> "StudyPlan":
        """
        Raises:
            FileFormatError: the file does not exist, is no plan, or was changed after it was made.
        """
        content = read_json(path, dict[str, Any], _EXPECTED)
        try:
            if content["study_plan"] != _VERSION:
                raise FileFormatError(path, f"{_EXPECTED}, version {_VERSION}", f"version {content['study_plan']}")
            content["task_name"] = content.pop("task", TABLE)
            content["questionnaires"] = tuple(
                Questionnaire.from_json(json.dumps(form), path) for form in content.get("questionnaires", ())
            )
            content["world"] = {name: content[name] for name in _WORLD if name in content}
            fields = {name: content[name] for name in cls.__dataclass_fields__}
            task = get_task(content["task_name"])
            fields["robots"] = tuple(Robot(**entry) for entry in content["robots"])
            fields["configurations"] = tuple(_scenario(task, entry) for entry in content["configurations"])
            fields["trials"] = {
                name: tuple(PlannedTrial(**entry) for entry in trials) for name, trials in content["trials"].items()
            }
            plan = cls(**fields)
            digest = plan_digest(plan)
            plan.world_settings  # noqa: B018 (checks the settings)
        except (KeyError, TypeError, AttributeError, ValueError, InvalidValueError) as error:
            raise FileFormatError(path, _EXPECTED, f"none: {type(error).__name__} {error}") from None
        if plan.plan_id != digest:
            raise FileFormatError(path, f"the plan {plan.plan_id} as it was made", f"a changed one, {digest}")
        return plan


def weights_digest(checkpoint: str) -> str:
    """The sha256 of a checkpoint's weights, computed without loading the policy.

    Raises:
        FileFormatError: the checkpoint does not exist.
    """
    return hashlib.sha256((checkpoint_folder(checkpoint) / "model.safetensors").read_bytes()).hexdigest()


def _columns(task: PairTask, scenario: Any) -> dict[str, Any]:
    """The names of a start in the plan's file; for a scenario from a file the same columns as in recordings."""
    name = task.name_of(scenario)
    return name.columns if name.digest else {"map_id": name.scenario}


def _scenario(task: PairTask, entry: dict[str, Any]) -> Any:
    columns = ScenarioName("", "").columns
    scenario = task.scenario_of_json(json.dumps({name: value for name, value in entry.items() if name not in columns}))
    if "map_set_digest" not in entry or not hasattr(scenario, "named"):
        return scenario
    return replace(scenario, named=ScenarioName(*(entry[name] for name in columns)))


def _content(plan: StudyPlan, configurations: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The fields of a plan as in its file; a file without `task` is of the table."""
    content: dict[str, Any] = {}
    for name, value in asdict(replace(plan, configurations=(), questionnaires=())).items():
        content |= value if name == "world" else {name: value}
    content["configurations"] = list(configurations)
    content["questionnaires"] = [form.to_json() for form in plan.questionnaires]
    # Plans made before these fields existed keep their digest.
    if not plan.questionnaires:
        del content["questionnaires"]
    robots = [(robot, name) for robot in content["robots"] for name in ("method", "processors_sha256")]
    for entry, name in robots + [(trial, "front") for trials in content["trials"].values() for trial in trials]:
        if not entry[name]:
            del entry[name]
    if (task := content.pop("task_name")) != TABLE:
        content["task"] = task
    return content


def plan_digest(plan: StudyPlan) -> str:
    """Eight hexadecimal digits of the hash of a plan's content without its id."""
    configurations = [
        asdict(scenario) if is_dataclass(type(scenario)) else json.loads(scenario.to_json())
        for scenario in plan.configurations
    ]
    for entry in configurations:
        for name in ("obstacle_sizes", "named"):  # plans made before these fields existed keep their digest
            if name in entry and not entry[name]:
                del entry[name]
    content = {**_content(plan, configurations), "plan_id": ""}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:8]
