"""`copolicy-eval human plan | run | summarise`."""

import argparse
from pathlib import Path

from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
from copolicy.collect.agents.training_conditions import training_conditions
from copolicy.dataset.command_line.commands import add_command, add_group
from copolicy.dataset.command_line.extras import POLICIES
from copolicy.dataset.command_line.flag_numbers import add_whole_number, number
from copolicy.dataset.command_line.maps_flag import add_maps_flag, set_name
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.file_kinds import kind_of
from copolicy.dataset.files.listing import visible_files
from copolicy.dataset.files.staging import require_new
from copolicy.dataset.publication.licences import checked_licence

from ..partner_study.configurations import MAPS, study_configurations
from ..result_file import write_json
from ..study_flags import (
    add_protocol_flags,
    policy_settings,
    protocol_of,
    stated_settings,
    task_entry,
    unseen_entry,
)


def add_human_command(commands: argparse._SubParsersAction) -> None:
    """Adds `human` with its three steps to the commands of `copolicy-eval`."""
    steps = add_group(
        commands,
        "human",
        "the human study: plan it, run a person's session, summarise the recordings",
        "A person at the human seat with one robot after the other, blind and counterbalanced.",
        (
            "copolicy-eval human plan CoDP-H=outputs/codp_h CoDP=outputs/codp --out study/plan.json",
            "copolicy-eval human run study/plan.json --participant P01 --out study/recordings",
            "copolicy-eval human summarise study/recordings --plan study/plan.json --out study/result.json",
        ),
    )
    _add_plan(steps)
    _add_run(steps)
    _add_summarise(steps)


def _add_plan(steps: argparse._SubParsersAction) -> None:
    command = add_command(
        steps,
        "plan",
        _plan,
        "write the schedule: who carries with which robot on which start, in which order",
        "copolicy-eval human plan CoDP-H=outputs/codp_h CoDP=outputs/codp --participants 5 --out study/plan.json",
    )
    command.add_argument("policies", nargs="+", metavar="NAME=CKPT", help="robots to compare, at least two")
    add_whole_number(command, "--participants", "how many people (default: 5, the paper's)", 5, 1, 10_000)
    add_maps_flag(command, MAPS, given=False)
    add_whole_number(
        command,
        "--configurations",
        "starts shared out among people, as in `partner` (default: 60, or all of a smaller set)",
        None,
        None,
    )
    add_whole_number(
        command,
        "--episodes-per-robot",
        "starts of each person, the same with every robot (default: 12, or as many as there are)",
        None,
        1,
        10_000,
    )
    command.add_argument("--out", required=True, type=Path, help="where the plan goes; it holds the key: keep it shut")
    add_protocol_flags(command, actions_per_plan=1)


def _add_run(steps: argparse._SubParsersAction) -> None:
    command = add_command(
        steps,
        "run",
        _run,
        "one person's session in the window of `copolicy-collect play`; it goes on where it was left",
        "copolicy-eval human run study/plan.json --participant P01 --out study/recordings --consent C-17",
        POLICIES,
    )
    command.add_argument("plan", type=Path, help="of `copolicy-eval human plan`")
    command.add_argument("--participant", required=True, help="as the plan names them: P01, P02, ...")
    command.add_argument("--out", required=True, type=Path, help="folder of all sessions, an MCAP file an episode")
    command.add_argument(
        "--human", default="joystick", help="joystick, keyboard, or scripted[:PAIR] to try the procedure without people"
    )
    add_whole_number(command, "--practice", "episodes to get used to it, not counted (default: 2)", 2, 0, 1000)
    command.add_argument("--consent", default="", metavar="ID", help="record id of the person's consent, no name")
    command.add_argument("--license", default="", help="of the recordings, as the Hub spells it, such as cc-by-4.0")
    command.add_argument(
        "--countdown", type=number("--countdown", 0, 60), default=3.0, help="seconds before each episode (default: 3)"
    )
    command.add_argument("--device", default="cpu", help="where the robots plan (default: cpu)")
    command.add_argument("--new-session", action="store_true", help="do not continue the unfinished session")
    command.add_argument("--headless", action="store_true", help="no window, in real time; every episode is kept")
    command.add_argument("--fullscreen", action="store_true", help="begin in full screen")
    command.add_argument("--mute", action="store_true", help="no sounds")


def _add_summarise(steps: argparse._SubParsersAction) -> None:
    command = add_command(
        steps,
        "summarise",
        _summarise,
        "success, time, interaction force and ratings of each robot, with the paper's tests between them",
        "copolicy-eval human summarise study/recordings --plan study/plan.json --ratings study/ratings.csv "
        "--out study/result.json",
    )
    command.add_argument("recordings", type=Path, help="folder of sessions")
    command.add_argument("--plan", type=Path, help="the key (default: robots by what recordings say of their seat)")
    command.add_argument(
        "--ratings", type=Path, metavar="FILE", help="CSV or JSON with participant, block and a column a question"
    )
    command.add_argument("--out", type=Path, help="write everything, with every episode, as JSON")
    command.add_argument("--overwrite", action="store_true", help="replace an existing result")


def _plan(arguments: argparse.Namespace) -> dict:
    from ..partner_study.command import split_name
    from .plan import Robot, make_plan, williams_square

    require_new(arguments.out, overwrite=arguments.overwrite)
    robots = []
    for text in arguments.policies:
        name, path = split_name(text)
        if not name:
            raise InvalidValueError("NAME=CKPT", "a name for each robot", text)
        robots.append(Robot.of(name, path))
    folders = [(robot.name, checkpoint_folder(robot.checkpoint)) for robot in robots]
    protocol = protocol_of(arguments, [(name, training_conditions(folder)) for name, folder in folders])
    chosen = protocol.task.scenario_set(set_name(protocol.task, arguments.maps, MAPS))
    starts = study_configurations(chosen, arguments.configurations)
    asked, (stated, unusual) = arguments.episodes_per_robot, stated_settings(protocol.task, protocol.physics)
    plan = make_plan(
        robots,
        chosen.label,
        starts,
        arguments.participants,
        min(12, len(starts)) if asked is None else asked,
        arguments.seed,
        actions_per_plan=arguments.n_action_steps,
        world={**stated, **unusual},
        settings=policy_settings(arguments),
        task_name=protocol.task.spec.name,
    )
    write_json(arguments.out, plan.to_json())
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


def _run(arguments: argparse.Namespace) -> dict:
    from copolicy.collect.play.settings import PlayerSpec

    from .plan import StudyPlan

    checked_licence(arguments.license)
    plan = StudyPlan.read(arguments.plan)
    plan.of(arguments.participant)
    human = PlayerSpec.parse(arguments.human, plan.task_name)
    # Deferred: a wrong call should not wait for torch and pygame.
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


def _summarise(arguments: argparse.Namespace) -> dict:
    from .plan import StudyPlan
    from .questionnaire import read_ratings
    from .recordings import study_rows
    from .summary import summarise_study

    if arguments.out:
        require_new(arguments.out, overwrite=arguments.overwrite)
    if arguments.ratings and not arguments.plan:
        raise InvalidValueError("--ratings", "--plan beside it, which tells the robot of each block", "none")
    if not arguments.recordings.is_dir() or not visible_files(arguments.recordings, "*.mcap"):
        raise FileFormatError(arguments.recordings, "a folder of recordings", kind_of(arguments.recordings))
    plan = StudyPlan.read(arguments.plan) if arguments.plan else None
    ratings = read_ratings(arguments.ratings, plan) if arguments.ratings and plan else []
    rows, left_out = study_rows(arguments.recordings, plan)
    summary = summarise_study(rows, ratings)
    planned = sum(len(trials) for trials in plan.trials.values()) if plan else None
    about = {"episodes": len(rows), "planned": planned, "left_out": left_out}
    if arguments.out:
        settings = (
            {}
            if plan is None
            else {
                **task_entry(plan.task),
                "plan_id": plan.plan_id,
                "maps": plan.maps,
                **plan.map_set,
                "step_limit": plan.physics.step_limit,
            }
        )
        write_json(
            arguments.out,
            {"study": "human", "settings": settings, **summary, **about, "rows": rows, "answers": ratings},
        )
        about["result"] = str(arguments.out)
    if arguments.json:
        return {**summary, **about}
    return {"label": summary["label"], **about, **_lines(summary)}


def _lines(summary: dict) -> dict:
    robots = {}
    for name, one in summary["robots"].items():
        robots[name] = {"success": _value(one["success"], 100, 1, " %"), "time": _value(one["time_s"], 1, 2, " s")}
        if "interaction_mean" in summary["tests"]:
            robots[name]["interaction_force"] = _value(one["interaction_mean"], 1, 4, "")
    tests = {}
    for measure, test in summary["tests"].items():
        f = test["anova"]
        tests[measure] = (
            "no test: at least two people with a value for every robot, and some spread"
            if f is None
            else f"F({f['df'][0]}, {f['df'][1]}) = {f['F']:.2f}, p = {f['p']:.3g}"
        )
    ratings = {
        question: {robot: _value(value, 1, 2, "") for robot, value in one["robots"].items()}
        for question, one in summary.get("ratings", {}).items()
    }
    missing = {name: summary[name] for name in ("not_measured",) if name in summary}
    return {"robots": robots, "anova": tests, **({"ratings": ratings} if ratings else {}), **missing}


def _value(one: dict, scale: float, digits: int, unit: str) -> str:
    if one["mean"] is None:
        return "none"
    error = one["standard_error"]
    spread = "" if error is None else f" ± {scale * error:.{digits}f}"
    return f"{scale * one['mean']:.{digits}f}{spread}{unit} (of {one['participants']} people)"
