"""`copolicy-eval partner`."""

import argparse
from pathlib import Path
from typing import Any

from copolicy.collect.agents.simulated_players import simulated_players
from copolicy.dataset.command_line.commands import Commands, add_command, progress_bar
from copolicy.dataset.command_line.flag_numbers import LARGEST_SEED, add_whole_number
from copolicy.dataset.command_line.maps_flag import add_maps_flag, map_set_name
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.staging import require_new
from copolicy.dataset.task import get_task

from ..partners.names import PARTNERS_HELP, PROXY, parse_partners, partners_label
from ..study_flags import (
    POLICY_HELP,
    add_study_flags,
    checkpoint_task,
    figure_beside,
    study_needs,
    study_protocol,
    study_settings,
)
from ..summary import not_measured, percent
from ..trajectories import BESIDE_RESULT, add_trajectories_flag, trajectories_beside, write_result
from .configurations import DEFAULT_MAPS, DEFAULT_STARTS, study_configurations
from .robots import HIDDEN_HELP, make_robot, robot_rate, scripted_robots, split_robot


def add_partner_command(commands: Commands) -> None:
    """Adds `partner` to the commands of `copolicy-eval`."""
    command = add_command(
        commands,
        "partner",
        _partner,
        "a policy acts as the robot, simulated partners of several kinds as the human",
        "copolicy-eval partner outputs/codp_h --baseline outputs/codp passive never-yields --out partner.json",
        study_needs,
    )
    command.add_argument(
        "policy", metavar="[NAME=]CKPT", help=f"{POLICY_HELP}; and its name in the result. {HIDDEN_HELP}"
    )
    command.add_argument(
        "--baseline",
        nargs="+",
        metavar="[NAME=]CKPT",
        help="robots to compare with, on the same starts with the same partners: other checkpoints, passive (zero "
        "force; also nothing), never-yields (a scripted agent that never yields), scripted (a scripted agent with the "
        "default profile) or random (random forces) (default: passive and the task's first scripted robot, which is "
        "never-yields for the table)",
    )
    command.add_argument("--no-baseline", dest="baseline", action="store_const", const=[], help="use no baselines")
    add_maps_flag(command, DEFAULT_MAPS, use_default=False)
    add_whole_number(
        command,
        "--configurations",
        "number of starts: N / 4 maps, spread over the set, in four orientations each; N maps for a task without "
        f"orientations (default: {DEFAULT_STARTS}, or all of a smaller set)",
        None,
        None,
    )
    kinds = ", ".join(simulated_players(get_task()).partners)
    text = f"{PARTNERS_HELP} (default: all scripted kinds; for the table {kinds})"
    command.add_argument("--partners", nargs="+", metavar="PARTNER", help=text)
    add_overlap_flag(command)
    add_whole_number(command, "--repeats", "partners of each kind for each start (default: 1)", 1, 1, 10_000)
    add_whole_number(command, "--partner-seed", "seed of the partners (default: 0)", 0, None, LARGEST_SEED)
    command.add_argument("--out", required=True, type=Path, help="result file (JSON); the figure is written beside it")
    add_trajectories_flag(command, BESIDE_RESULT)
    add_study_flags(command, n_action_steps=1)


def add_overlap_flag(command: argparse.ArgumentParser) -> None:
    """Adds `--allow-overlap`."""
    text = "run a robot with a proxy that learned from the same pairs; the result says so"
    command.add_argument("--allow-overlap", action="store_true", help=text)


def _partner(arguments: argparse.Namespace) -> dict[str, Any]:
    figure, trajectories = figure_beside(arguments.out), trajectories_beside(arguments.out)
    require_new(arguments.out, figure, trajectories, overwrite=arguments.overwrite)
    if arguments.partner_seed < 0:
        raise InvalidValueError("--partner-seed", "a whole number, not negative", arguments.partner_seed)
    path = split_robot(arguments.policy)[1]
    task = checkpoint_task(path)
    profiles = simulated_players(task).partners
    named = parse_partners(profiles if arguments.partners is None else arguments.partners, task)
    chosen = task.scenario_set(map_set_name(task, arguments.maps, DEFAULT_MAPS))
    # Imported here so that `--help` and argument errors do not wait for torch.
    from ..partners.overlap import check_overlap
    from ..partners.partner import make_partner
    from .figure import save_partner_figure
    from .settings import partner_settings
    from .study import run_with_partners
    from .summary import definitions, differences, summarise_with_partners

    scenarios = study_configurations(chosen, arguments.configurations)
    scripted = scripted_robots(task)
    baseline = list(scripted)[:2] if arguments.baseline is None else arguments.baseline
    robots = [make_robot(text, arguments, scripted) for text in (arguments.policy, *baseline)]
    names = [robot.name for robot in robots]
    if len(set(names)) < len(names):
        raise InvalidValueError("--baseline", "robots of different names (NAME=CKPT gives one)", names)
    checkpoints = {robot.name: robot.policy.folder for robot in robots if robot.policy is not None}
    proxies = {partner.name: partner.detail for partner in named if partner.kind == PROXY}
    overlap = check_overlap(checkpoints, proxies, arguments.allow_overlap)
    policies = [(robot.name, robot.policy.conditions) for robot in robots if robot.policy is not None]
    protocol = study_protocol(arguments, policies)
    partners = [make_partner(partner, task, protocol, arguments.device, len(scenarios)) for partner in named]
    if partners[0].recorded is not None:
        scenarios = partners[0].recorded.scenarios
    by_robot = []
    episodes_per_robot = len(scenarios) * len(partners) * arguments.repeats
    with progress_bar(episodes_per_robot * len(robots), "episodes") as bar:
        for index, robot in enumerate(robots):
            episodes = run_with_partners(
                robot,
                scenarios,
                partners,
                protocol.settings,
                task=task,
                repeats=arguments.repeats,
                fps=robot_rate(robot, arguments.fps, task),
                seed=arguments.seed,
                partner_seed=arguments.partner_seed,
                on_step=lambda finished, done=index * episodes_per_robot: bar.update(done + finished - bar.n),
            )
            by_robot.append(episodes)
    pairs = list(zip(robots, by_robot, strict=True))
    summaries = [summarise_with_partners(episodes, robot.policy) for robot, episodes in pairs]
    described = [
        {
            "name": robot.name,
            "policy": robot.describe(),
            "summary": summary,
            "episodes": [episode.to_json() for episode in episodes],
        }
        for (robot, episodes), summary in zip(pairs, summaries, strict=True)
    ]
    paired = {name: differences(by_robot[0], baseline) for name, baseline in zip(names[1:], by_robot[1:], strict=True)}
    result = {
        "study": "partner",
        "label": partners_label(named, task),
        **described[0],
        "settings": {
            **partner_settings(chosen, len(scenarios), partners, arguments.partner_seed, arguments.repeats),
            **study_settings(arguments, protocol, scenarios),
            **({"starts": "the recorded ones of the replay"} if partners[0].recorded is not None else {}),
        },
        **({"overlap": overlap} if overlap else {}),
        **not_measured(task, summaries[0]),
        "definitions": definitions(task, summaries[0]),
        "baselines": described[1:],
        "differences": paired,
    }
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    by_name = dict(zip(names, summaries, strict=True))
    size = f"{len(scenarios)} starts, {episodes_per_robot} episodes per robot"
    title = f"simulated partners on {chosen.label}: {size}, no person"
    save_partner_figure(by_name, figure, title)
    with_names = ((robot.name, episode) for robot, episodes in pairs for episode in episodes)
    write_result(arguments.out, result, task, result["label"], with_names if arguments.trajectories else None)
    return {
        "label": "simulated partners, no person took part",
        "episodes_per_robot": episodes_per_robot,
        "robots": {name: _report(summary) for name, summary in by_name.items()},
        "success_difference": {
            f"{names[0]} - {name}": _difference(by_kind["all"]["success"]) for name, by_kind in paired.items()
        },
        "result": str(arguments.out),
        "figure": str(figure),
        **({"trajectories": str(trajectories)} if arguments.trajectories else {}),
        **not_measured(task, summaries[0]),
    }


def _report(summary: dict) -> dict[str, Any]:
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


def _difference(success: dict) -> str:
    mean = f"{100 * success['mean']:+.1f} points"
    if success["bootstrap_95"] is None:
        return f"{mean} (one map: no interval)"
    low, high = (100 * bound for bound in success["bootstrap_95"])
    return f"{mean} (95 % {low:+.1f} to {high:+.1f}, bootstrap over {success['maps']} maps)"
