"""`copolicy-eval human plan | run | summarise`."""

import argparse
from pathlib import Path
from typing import Any

from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
from copolicy.collect.agents.training_conditions import training_conditions
from copolicy.dataset.command_line.commands import Commands, add_command, add_group
from copolicy.dataset.command_line.extras import POLICIES
from copolicy.dataset.command_line.flag_numbers import add_whole_number, number
from copolicy.dataset.command_line.maps_flag import add_maps_flag, map_set_name
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.file_kinds import describe_path
from copolicy.dataset.files.listing import visible_files
from copolicy.dataset.files.staging import replace_json, require_new
from copolicy.dataset.publication.licences import checked_licence

from ..partner_study.configurations import DEFAULT_MAPS, study_configurations
from ..study_flags import (
    add_protocol_flags,
    policy_settings,
    recorded_settings,
    study_protocol,
    task_entry,
    unseen_entry,
)


def add_human_command(commands: Commands) -> None:
    """Adds `human` with its three steps to the commands of `copolicy-eval`."""
    steps = add_group(
        commands,
        "human",
        "the human study: plan it, run a person's session, summarise the recordings",
        "A person at the human's seat with several robots in turn, blind and counterbalanced.",
        (
            "copolicy-eval human plan CoDP-H=outputs/codp_h CoDP=outputs/codp --out study/plan.json",
            "copolicy-eval human run study/plan.json --participant P01 --out study/recordings",
            "copolicy-eval human summarise study/recordings --plan study/plan.json --out study/result.json",
        ),
    )
    _add_plan(steps)
    _add_run(steps)
    _add_summarise(steps)


def _add_plan(steps: Commands) -> None:
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
    command.add_argument("--out", required=True, type=Path, help="plan to write; it names the robots: keep it secret")
    add_protocol_flags(command, n_action_steps=1)


def _add_run(steps: Commands) -> None:
    command = add_command(
        steps,
        "run",
        _run,
        "run a participant's session in the window of `copolicy-collect play`, or continue an unfinished one",
        "copolicy-eval human run study/plan.json --participant P01 --out study/recordings --consent C-17",
        POLICIES,
    )
    command.add_argument("plan", type=Path, help="file written by `copolicy-eval human plan`")
    command.add_argument("--participant", required=True, help="code of the participant in the plan: P01, P02, ...")
    command.add_argument("--out", required=True, type=Path, help="folder of all sessions, one MCAP file per episode")
    command.add_argument(
        "--human", default="joystick", help="joystick, keyboard, or scripted[:PAIR] to try the procedure without people"
    )
    add_whole_number(command, "--practice", "practice episodes, not counted (default: 2)", 2, 0, 1000)
    command.add_argument("--consent", default="", metavar="ID", help="record id of the person's consent, not a name")
    command.add_argument("--license", default="", help="licence of the recordings, a Hub id such as cc-by-4.0")
    command.add_argument(
        "--countdown", type=number("--countdown", 0, 60), default=3.0, help="seconds before each episode (default: 3)"
    )
    command.add_argument("--device", default="cpu", help="device of the policies (default: cpu)")
    command.add_argument("--new-session", action="store_true", help="do not continue the unfinished session")
    command.add_argument("--headless", action="store_true", help="no window, in real time; every episode is kept")
    command.add_argument("--fullscreen", action="store_true", help="start in full screen")
    command.add_argument("--mute", action="store_true", help="no sounds")


def _add_summarise(steps: Commands) -> None:
    command = add_command(
        steps,
        "summarise",
        _summarise,
        "success, time, interaction force and ratings of each robot, with the paper's tests of their differences",
        "copolicy-eval human summarise study/recordings --plan study/plan.json --ratings study/ratings.csv "
        "--out study/result.json",
    )
    command.add_argument("recordings", type=Path, help="folder of sessions")
    command.add_argument("--plan", type=Path, help="study plan (default: robots are named as in the recordings)")
    command.add_argument(
        "--ratings", type=Path, metavar="FILE", help="CSV or JSON with participant, block and one column per question"
    )
    command.add_argument("--out", type=Path, help="write the summary and all episodes as JSON")
    command.add_argument("--overwrite", action="store_true", help="replace an existing result")


def _plan(arguments: argparse.Namespace) -> dict[str, Any]:
    from ..partner_study.robots import split_name
    from .plan import Robot, make_plan, williams_square

    require_new(arguments.out, overwrite=arguments.overwrite)
    robots = []
    for text in arguments.policies:
        name, path = split_name(text)
        if not name:
            raise InvalidValueError("NAME=CKPT", "a name for each robot", text)
        robots.append(Robot.from_checkpoint(name, path))
    folders = [(robot.name, checkpoint_folder(robot.checkpoint)) for robot in robots]
    protocol = study_protocol(arguments, [(name, training_conditions(folder)) for name, folder in folders])
    chosen = protocol.task.scenario_set(map_set_name(protocol.task, arguments.maps, DEFAULT_MAPS))
    starts = study_configurations(chosen, arguments.configurations)
    flagged, unusual = recorded_settings(protocol.task, protocol.settings)
    plan = make_plan(
        robots,
        chosen.label,
        starts,
        arguments.participants,
        min(12, len(starts)) if arguments.episodes_per_robot is None else arguments.episodes_per_robot,
        arguments.seed,
        actions_per_plan=arguments.n_action_steps,
        world={**flagged, **unusual},
        settings=policy_settings(arguments),
        task_name=protocol.task.spec.name,
    )
    replace_json(arguments.out, plan.to_json(), indent=1)
    orders = len(williams_square(len(robots)))
    return {
        "plan": str(arguments.out),
        "plan_id": plan.plan_id,
        "participants": list(plan.trials),
        "robots": [robot.name for robot in robots],
        "episodes_per_participant": len(next(iter(plan.trials.values()))),
        "counterbalanced": f"{orders} orders of robots"
        + ("" if arguments.participants % orders == 0 else f": complete only with a multiple of {orders} participants"),
        "next": f"copolicy-eval human run {arguments.out} --participant {next(iter(plan.trials))} --out RECORDINGS",
        **unseen_entry(protocol.task, starts),
    }


def _run(arguments: argparse.Namespace) -> dict[str, Any]:
    from copolicy.collect.play.settings import PlayerSpec

    from .plan import StudyPlan

    checked_licence(arguments.license)
    plan = StudyPlan.read(arguments.plan)
    plan.trials_of(arguments.participant)
    human = PlayerSpec.parse(arguments.human, plan.task_name)
    # Imported here so that argument errors do not wait for torch and pygame.
    from .session import run_session

    return run_session(
        plan,
        arguments.participant,
        human,
        arguments.out,
        arguments.device,
        practice=arguments.practice,
        consents=("", arguments.consent),
        license=arguments.license,
        countdown_s=arguments.countdown,
        new_session=arguments.new_session,
        headless=arguments.headless,
        fullscreen=arguments.fullscreen,
        mute=arguments.mute,
    )


def _summarise(arguments: argparse.Namespace) -> dict[str, Any]:
    from .plan import StudyPlan
    from .questionnaire import read_ratings
    from .recordings import study_rows
    from .summary import summarise_study

    if arguments.out:
        require_new(arguments.out, overwrite=arguments.overwrite)
    if arguments.ratings and not arguments.plan:
        raise InvalidValueError("--ratings", "--plan too, which names the robot of each block", "none")
    if not arguments.recordings.is_dir() or not visible_files(arguments.recordings, "*.mcap"):
        raise FileFormatError(arguments.recordings, "a folder of recordings", describe_path(arguments.recordings))
    plan = StudyPlan.read(arguments.plan) if arguments.plan else None
    ratings = read_ratings(arguments.ratings, plan) if arguments.ratings and plan else []
    rows, left_out = study_rows(arguments.recordings, plan)
    summary = summarise_study(rows, ratings)
    planned = sum(len(trials) for trials in plan.trials.values()) if plan else None
    counts = {"episodes": len(rows), "planned": planned, "left_out": left_out}
    if arguments.out:
        settings = (
            {}
            if plan is None
            else {
                **task_entry(plan.task),
                "plan_id": plan.plan_id,
                "maps": plan.maps,
                **plan.map_set,
                "step_limit": plan.world_settings.step_limit,
            }
        )
        result = {"study": "human", "settings": settings, **summary, **counts, "rows": rows, "answers": ratings}
        replace_json(arguments.out, result, indent=1)
        counts["result"] = str(arguments.out)
    if arguments.json:
        return {**summary, **counts}
    return {"label": summary["label"], **counts, **_report(summary)}


def _report(summary: dict) -> dict[str, Any]:
    robots = {}
    for name, robot in summary["robots"].items():
        robots[name] = {"success": _value(robot["success"], 100, 1, " %"), "time": _value(robot["time_s"], 1, 2, " s")}
        if "interaction_mean" in summary["tests"]:
            robots[name]["interaction_force"] = _value(robot["interaction_mean"], 1, 4, "")
    tests = {}
    for measure, test in summary["tests"].items():
        effects = test["anova"]
        if not effects:
            tests[measure] = "no test: it needs at least two people with a value for every robot, and some spread"
            continue
        f, n = effects[0], len(test["units"])
        tests[measure] = (
            f"F({f['df'][0]}, {f['df'][1]}) = {f['F']:.2f}, p = {f['p']:.3g}, Greenhouse-Geisser "
            f"{f['p_greenhouse_geisser']:.3g}, of {n} people; recommended: {test['recommended']}"
        )
    ratings = {
        question: {robot: _value(rating, 1, 2, "") for robot, rating in answers["robots"].items()}
        for question, answers in summary.get("ratings", {}).items()
    }
    missing = {name: summary[name] for name in ("not_measured",) if name in summary}
    return {"robots": robots, "anova": tests, **({"ratings": ratings} if ratings else {}), **missing}


def _value(measure: dict, scale: float, digits: int, unit: str) -> str:
    if measure["mean"] is None:
        return "none"
    error = measure["standard_error"]
    spread = "" if error is None else f" ± {scale * error:.{digits}f}"
    return f"{scale * measure['mean']:.{digits}f}{spread}{unit} (of {measure['participants']} people)"
