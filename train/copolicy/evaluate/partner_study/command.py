"""`copolicy-eval partner`."""

import argparse
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from copolicy.collect.agents.simulated import simulated_players
from copolicy.dataset.command_line.commands import add_command, progress_bar
from copolicy.dataset.command_line.flag_numbers import LARGEST_SEED, add_whole_number
from copolicy.dataset.command_line.maps_flag import add_maps_flag, map_set_name
from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.files.staging import require_new
from copolicy.dataset.task import get_task

from ..result_file import write_json
from ..study_flags import add_study_flags, learned_task, policy_of, protocol_of, study_needs, study_settings
from ..summary import not_measured, percent
from .configurations import MAPS, USUAL, all_starts, study_configurations

if TYPE_CHECKING:
    from .robots import Robot

_LABEL = "human-in-the-loop protocol with SIMULATED partners: "
_PARTNERS = "scripted players sit at the human seat, no person took part"


def add_partner_command(commands: argparse._SubParsersAction) -> None:
    """Adds `partner` to the commands of `copolicy-eval`."""
    command = add_command(
        commands,
        "partner",
        _partner,
        "the robot's half of a checkpoint with simulated partners of several kinds at the human seat",
        "copolicy-eval partner outputs/codp_h --baseline outputs/codp passive never-yields --out partner.json",
        study_needs,
    )
    command.add_argument("policy", metavar="[NAME=]CKPT", help="checkpoint folder, with a name for the result")
    command.add_argument(
        "--baseline",
        nargs="+",
        metavar="[NAME=]CKPT",
        help="other checkpoints, passive (zero force), never-yields (scripted, endless patience) or scripted (a usual "
        "simulated pilot), on the same starts with the same partners (default: passive, and the first scripted robot "
        "of the task, for the table never-yields)",
    )
    command.add_argument("--no-baseline", dest="baseline", action="store_const", const=[], help="the checkpoint alone")
    add_maps_flag(command, MAPS, use_default=False)
    add_whole_number(
        command,
        "--configurations",
        "starts: a quarter as many maps, spread over the set, each in four orientations; of a task without "
        f"orientations as many maps (default: {USUAL}, or all of a smaller set)",
        None,
        None,
    )
    kinds = ", ".join(simulated_players(get_task()).partners)
    command.add_argument(
        "--partners", nargs="+", metavar="KIND", help=f"kinds that the task has, the table {kinds} (default: all)"
    )
    add_whole_number(command, "--repeats", "partners of each kind on each start (default: 1)", 1, 1, 10_000)
    add_whole_number(command, "--partner-seed", "seed of the partners (default: 0)", 0, None, LARGEST_SEED)
    command.add_argument("--out", required=True, type=Path, help="where the result goes; the picture stands beside it")
    add_study_flags(command, actions_per_plan=1)


def _partner(arguments: argparse.Namespace) -> dict:
    picture = arguments.out.with_suffix(".png")
    require_new(arguments.out, picture, overwrite=arguments.overwrite)
    if arguments.partner_seed < 0:
        raise InvalidValueError("--partner-seed", "a whole number, not negative", arguments.partner_seed)
    _, path = split_name(arguments.policy)
    task = learned_task(path)
    profiles = simulated_players(task).partners
    partners = list(dict.fromkeys(profiles if arguments.partners is None else arguments.partners))
    for kind in partners:
        if kind not in profiles:
            raise UnknownNameError("kind of partner", kind, profiles)
    chosen = task.scenario_set(map_set_name(task, arguments.maps, MAPS))
    # Deferred: `--help` and a wrong call should not wait for torch.
    from .figure import save_partner_figure
    from .robots import scripted_robots
    from .study import carry_with_partners
    from .summary import definitions, differences, summarise_with_partners

    maps = study_configurations(chosen, arguments.configurations)
    scripted = scripted_robots(task)
    baseline = list(scripted)[:2] if arguments.baseline is None else arguments.baseline
    robots = [make_robot(text, arguments, scripted) for text in (arguments.policy, *baseline)]
    names = [robot.name for robot in robots]
    if len(set(names)) < len(names):
        raise InvalidValueError("--baseline", "robots of different names (NAME=CKPT gives one)", names)
    policies = [(robot.name, robot.policy.conditions) for robot in robots if robot.policy is not None]
    protocol = protocol_of(arguments, policies)
    # Each policy plans at its own rate; a scripted robot acts at every step of the world.
    rates = [
        protocol.fps if arguments.fps is not None or robot.policy is None else robot.policy.fps for robot in robots
    ]
    found = []
    episodes = len(maps) * len(partners) * arguments.repeats
    with progress_bar(episodes * len(robots), "episodes") as bar:
        for place, (robot, fps) in enumerate(zip(robots, rates, strict=True)):
            outcomes = carry_with_partners(
                robot,
                maps,
                partners,
                protocol.physics,
                task=task,
                repeats=arguments.repeats,
                fps=fps,
                seed=arguments.seed,
                partner_seed=arguments.partner_seed,
                on_step=lambda finished, done=place * episodes: bar.update(done + finished - bar.n),
            )
            found.append(outcomes)
    summaries = [summarise_with_partners(outcomes, robot.policy) for robot, outcomes in zip(robots, found, strict=True)]
    described = [
        {
            "name": robot.name,
            "policy": robot.describe(),
            "summary": summary,
            "episodes": [o.to_json() for o in outcomes],
        }
        for robot, summary, outcomes in zip(robots, summaries, found, strict=True)
    ]
    paired = {robot.name: differences(found[0], other) for robot, other in zip(robots[1:], found[1:], strict=True)}
    result = {
        "study": "partner",
        "label": _LABEL + task.studies.definitions.get("partners", _PARTNERS),
        **described[0],
        "settings": {
            "maps": chosen.label,
            "map_set": chosen.describe(),
            "configurations": len(maps),
            "map_count": len(maps),
            "complete_set": len(maps) == len({config.digest for config in all_starts(chosen)}),
            "orientations": task.orientations > 1,
            "partners": {kind: asdict(profiles[kind]) for kind in partners},
            "partner_seed": arguments.partner_seed,
            "repeats": arguments.repeats,
            **study_settings(arguments, protocol, maps),
        },
        **not_measured(task, summaries[0]),
        "definitions": definitions(task, summaries[0]),
        "baselines": described[1:],
        "differences": paired,
    }
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    by_name = dict(zip(names, summaries, strict=True))
    title = f"simulated partners on {chosen.label}: {len(maps)} starts, {episodes} episodes a robot, no person"
    save_partner_figure(by_name, picture, title)
    write_json(arguments.out, result)
    return {
        "label": "simulated partners, no person took part",
        "episodes_per_robot": episodes,
        "robots": {name: _line(summary) for name, summary in by_name.items()},
        "success_difference": {
            f"{names[0]} - {name}": _difference(one["all"]["success"]) for name, one in paired.items()
        },
        "result": str(arguments.out),
        "picture": str(picture),
        **not_measured(task, summaries[0]),
    }


def make_robot(text: str, arguments: argparse.Namespace, scripted: Mapping[str, "Robot"]) -> "Robot":
    """The robot behind `[NAME=]CKPT` or one of the scripted names.

    Raises:
        FileFormatError: no such checkpoint.
        InvalidValueError: it plans fewer actions than are to be executed.
    """
    from .robots import policy_robot

    if text in scripted:
        return scripted[text]
    name, path = split_name(text)
    policy = policy_of(path, arguments)
    return policy_robot(name or policy.name, policy)


def split_name(text: str) -> tuple[str, str]:
    """`NAME=PATH` in two; the name is empty where there is none (a path may hold `=` behind a slash)."""
    name, sign, path = text.partition("=")
    return (name, path) if sign and "/" not in name and not Path(text).exists() else ("", text)


def _line(summary: dict) -> dict:
    time, force, deadlock = (summary[name] for name in ("time_to_completion_s", "interaction_force", "deadlock"))
    measures = {
        "interaction_force": None if force is None else round(force["mean"], 4),
        "robot_share": None if summary["robot_share"] is None else round(summary["robot_share"], 3),
        "deadlock_time_share": None if deadlock is None else round(deadlock["time_share"], 4),
    }
    return {
        "success": percent(summary["success"]),
        "time_s": None if time["mean"] is None else round(time["mean"], 2),
        **{name: value for name, value in measures.items() if value is not None},
        **{kind: f"{100 * part['success']['mean']:.1f} %" for kind, part in summary["by_partner"].items()},
    }


def _difference(one: dict) -> str:
    mean = f"{100 * one['mean']:+.1f} points"
    if one["bootstrap_95"] is None:
        return f"{mean} (one map: no interval)"
    low, high = (100 * bound for bound in one["bootstrap_95"])
    return f"{mean} (95 % {low:+.1f} to {high:+.1f}, bootstrap over {one['maps']} maps)"
