"""`copolicy-eval human plan`."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
from copolicy.collect.agents.training_conditions import training_conditions
from copolicy.collect.questionnaire import FORMS, Questionnaire, read_questionnaire
from copolicy.dataset.command_line.commands import Commands, add_command
from copolicy.dataset.command_line.flag_numbers import add_whole_number
from copolicy.dataset.command_line.maps_flag import add_maps_flag, map_set_name
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.staging import replace_json, require_new
from copolicy.dataset.task import PairTask

from ..file_names import split_name
from ..partner_study.configurations import DEFAULT_MAPS, front_configurations, study_configurations
from ..study_flags import add_protocol_flags, policy_settings, recorded_settings, study_protocol, unseen_entry

_FRONTS, _NONE = "fronts", "none"


def add_plan(steps: Commands) -> None:
    """Adds `human plan`."""
    command = add_command(
        steps,
        "plan",
        _plan,
        "write the schedule: robot and start of each trial of each participant",
        "copolicy-eval human plan CoDP-H=outputs/codp_h CoDP=outputs/codp --participants 5 --out study/plan.json",
    )
    command.add_argument("policies", nargs="+", metavar="NAME=CKPT", help="robots to compare, at least two")
    add_whole_number(command, "--participants", "number of participants (default: 5, as in the paper)", 5, 1, 10_000)
    add_maps_flag(command, DEFAULT_MAPS, use_default=False)
    add_whole_number(
        command,
        "--configurations",
        "number of starts, chosen as in `partner` and dealt to the participants (default: 60, or all of a smaller set)",
        None,
        None,
    )
    add_whole_number(
        command,
        "--episodes-per-robot",
        "starts of each participant, the same with every robot (default: 12, or all starts if there are fewer)",
        None,
        1,
        10_000,
    )
    command.add_argument(
        "--starts",
        choices=("fronts", "orientations"),
        help="fronts: each start with the person's end of the body in front and with the robot's, counterbalanced, as "
        "in the paper's robot study; orientations: the four of its study in simulation (default: fronts, if the task "
        "has them)",
    )
    command.add_argument(
        "--questionnaires",
        nargs="+",
        default=list(FORMS),
        metavar="NAME|FILE",
        help=f"asked after each block: {', '.join(FORMS)} or JSON files of your own; none for none "
        f"(default: {' '.join(FORMS)})",
    )
    command.add_argument("--out", required=True, type=Path, help="plan to write; it names the robots: keep it secret")
    add_protocol_flags(command, n_action_steps=1)


def _plan(arguments: argparse.Namespace) -> dict[str, Any]:
    from .design import make_plan, williams_square
    from .plan import Robot

    require_new(arguments.out, overwrite=arguments.overwrite)
    questionnaires = _questionnaires(arguments.questionnaires)
    robots = []
    for text in arguments.policies:
        name, path = split_name(text)
        if not name:
            raise InvalidValueError("NAME=CKPT", "a name for each robot", text)
        robots.append(Robot.from_checkpoint(name, path))
    folders = [(robot.name, checkpoint_folder(robot.checkpoint)) for robot in robots]
    protocol = study_protocol(arguments, [(name, training_conditions(folder)) for name, folder in folders])
    chosen = protocol.task.scenario_set(map_set_name(protocol.task, arguments.maps, DEFAULT_MAPS))
    fronts = _fronts(protocol.task, arguments.starts)
    count = arguments.configurations
    starts = front_configurations(chosen, count, fronts) if fronts else study_configurations(chosen, count)
    flagged, unusual = recorded_settings(protocol.task, protocol.settings)
    plan = make_plan(
        robots,
        chosen.label,
        starts,
        arguments.participants,
        min(12, len(starts)) if arguments.episodes_per_robot is None else arguments.episodes_per_robot,
        arguments.seed,
        fronts,
        actions_per_plan=arguments.n_action_steps,
        world={**flagged, **unusual},
        settings=policy_settings(arguments),
        task_name=protocol.task.spec.name,
        questionnaires=questionnaires,
    )
    replace_json(arguments.out, plan.to_json(), indent=1)
    orders = len(williams_square(len(robots))) * (len(fronts) or 1)
    what = "robots and set-ups" if fronts else "robots"
    return {
        "plan": str(arguments.out),
        "plan_id": plan.plan_id,
        "participants": list(plan.trials),
        "robots": [robot.name for robot in robots],
        "set_ups": list(fronts),
        "questionnaires": [form.name for form in questionnaires],
        "episodes_per_participant": len(next(iter(plan.trials.values()))),
        "counterbalanced": f"{orders} orders of {what}"
        + ("" if arguments.participants % orders == 0 else f": complete only with a multiple of {orders} participants"),
        "next": f"copolicy-eval human run {arguments.out} --participant {next(iter(plan.trials))} --out RECORDINGS",
        **unseen_entry(protocol.task, starts),
    }


def _questionnaires(names: Sequence[str]) -> tuple[Questionnaire, ...]:
    if list(names) == [_NONE]:
        return ()
    forms = tuple(read_questionnaire(name) for name in names)
    titles = [form.name for form in forms]
    if len(set(titles)) < len(titles):
        raise InvalidValueError("--questionnaires", "questionnaires of different names", titles)
    return forms


def _fronts(task: PairTask, starts: str | None) -> tuple[str, ...]:
    """The set-ups of the plan; none with the starts of the study in simulation."""
    fronts = task.studies.fronts
    if starts == _FRONTS and not fronts:
        raise InvalidValueError("--starts", "orientations", f"{_FRONTS}: {task.missing('front')}")
    return () if starts not in (None, _FRONTS) else fronts
