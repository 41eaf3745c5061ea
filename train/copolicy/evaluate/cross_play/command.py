"""`copolicy-eval cross-play`."""

import argparse
import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from copolicy.dataset.command_line.commands import Commands, add_command, progress_bar
from copolicy.dataset.command_line.flag_numbers import LARGEST_SEED, add_whole_number
from copolicy.dataset.command_line.maps_flag import add_maps_flag, map_set_name
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.lock import FolderLock
from copolicy.dataset.files.staging import replace_json, replace_text
from copolicy.dataset.task import PairTask, get_task

from ..partner_study.command import add_overlap_flag
from ..partner_study.configurations import DEFAULT_MAPS, DEFAULT_STARTS, study_configurations
from ..partner_study.robots import HIDDEN_HELP, make_robot, robot_rate, scripted_robots, split_robot
from ..partners.names import PARTNERS_HELP, PROXY, PartnerName, parse_partners, partners_label
from ..study_flags import POLICY_HELP, add_study_flags, checkpoint_task, study_needs, study_protocol, study_settings
from ..trajectories import add_trajectories_flag

if TYPE_CHECKING:
    from ..partner_study.robots import StudyRobot
    from ..partners.partner import StudyPartner
    from ..study_flags import Protocol
    from .cells import Play

_LOCK = ".lock"
_NAMES = ("nothing", "passive", "never-yields", "scripted", "random")


def add_cross_play_command(commands: Commands) -> None:
    """Adds `cross-play` to the commands of `copolicy-eval`."""
    command = add_command(
        commands,
        "cross-play",
        _cross_play,
        "every robot with every partner on the same starts, each planning for itself; a partner score and its ranking",
        "copolicy-eval cross-play --robots ours=outputs/run --partners P1=proxy:partners/P1 stubborn --out crossplay",
        study_needs,
    )
    command.add_argument(
        "--robots",
        required=True,
        nargs="+",
        metavar="[NAME=]CKPT",
        help=f"robots: {POLICY_HELP}, or a folder with runs of several training seeds, with a name in the result; or "
        f"{', '.join(_NAMES)}. {HIDDEN_HELP}",
    )
    command.add_argument("--partners", required=True, nargs="+", metavar="PARTNER", help=PARTNERS_HELP)
    floors = "do not add the floors nothing (zero force), random, and the task's first scripted robot"
    command.add_argument("--no-floors", action="store_true", help=floors)
    add_overlap_flag(command)
    add_maps_flag(command, DEFAULT_MAPS, use_default=False)
    add_whole_number(
        command,
        "--configurations",
        f"number of starts, spread over the set as in `partner` (default: {DEFAULT_STARTS}, or all of a smaller set); "
        "largest number of recorded starts of a replay",
    )
    add_whole_number(command, "--repeats", "partners of each kind for each start (default: 1)", 1, 1, 10_000)
    add_whole_number(command, "--partner-seed", "seed of the partners (default: 0)", 0, 0, LARGEST_SEED)
    command.add_argument(
        "--out",
        required=True,
        type=Path,
        metavar="FOLDER",
        help="folder of matrix.md, .csv, .json, .png and one file per cell; a second call continues a stopped run, and "
        "adds robots and partners",
    )
    add_trajectories_flag(command, "beside the file of each cell")
    add_study_flags(command, n_action_steps=1)


def _cross_play(arguments: argparse.Namespace) -> dict[str, Any]:
    if arguments.out.exists() and not arguments.out.is_dir():
        raise InvalidValueError("--out", "a folder", str(arguments.out))
    from .methods import with_seeds

    arguments.robots, methods = with_seeds(arguments.robots, _NAMES)
    task = _task(arguments)
    named = parse_partners(arguments.partners, task)
    chosen = task.scenario_set(map_set_name(task, arguments.maps, DEFAULT_MAPS))
    scenarios = study_configurations(chosen, arguments.configurations)
    # Imported here so that `--help` and argument errors do not wait for torch.
    from ..partners.overlap import check_overlap
    from ..partners.partner import make_partner
    from .cells import Play
    from .matrix import matrix_result

    scripted = scripted_robots(task)
    floors = [] if arguments.no_floors else ["nothing", *(task.agents.robots if task.agents else ()), "random"]
    floors = [name for name in floors if name != "scripted"]
    texts = list(dict.fromkeys((*arguments.robots, *(name for name in floors if not _given(name, arguments.robots)))))
    robots = [make_robot(text, arguments, scripted) for text in texts]
    _require_names([*(robot.name for robot in robots), *methods])
    checkpoints = {robot.name: robot.policy.folder for robot in robots if robot.policy is not None}
    proxies = {partner.name: partner.detail for partner in named if partner.kind == PROXY}
    overlap = check_overlap(checkpoints, proxies, arguments.allow_overlap)
    protocol = _protocol(arguments, robots, named)
    partners = [make_partner(each, task, protocol, arguments.device, len(scenarios)) for each in named]
    settings = {
        "maps": chosen.label,
        "map_set": chosen.describe(),
        "configurations": len(scenarios),
        "repeats": arguments.repeats,
        "partner_seed": arguments.partner_seed,
        **study_settings(arguments, protocol, scenarios),
    }
    digest = hashlib.sha256("".join(scenario.digest for scenario in scenarios).encode()).hexdigest()
    # The rate is of each robot. On another device the noise of a sampler can be another draw of the same distribution.
    shared = {
        name: value for name, value in settings.items() if name not in ("fps", "hold", "device", "told_otherwise")
    }
    play = Play(
        task,
        scenarios,
        protocol.settings,
        lambda robot: robot_rate(robot, arguments.fps, task),
        arguments.repeats,
        arguments.seed,
        arguments.partner_seed,
        {**shared, "starts_sha256": digest},
    )
    refusal = f"{arguments.out}: expected a folder in which no other cross-play runs, found one running"
    with FolderLock(arguments.out / _LOCK, refusal):
        cells = _run(arguments, play, robots, partners)
        floor_names = [robot.name for robot in robots if robot.name in ("nothing", "passive", "never-yields", "random")]
        factors = list(dict.fromkeys(name for each in scenarios for name in task.studies.factors(each)))
        result = matrix_result(task, settings, robots, partners, cells, floor_names, methods, factors)
        result = {"study": "cross-play", "label": partners_label(named, task), **result}
        if overlap:
            result["overlap"] = overlap
        return _write(arguments.out, result)


def _task(arguments: argparse.Namespace) -> PairTask:
    """The task of the first checkpoint among robots and partners; the table without any."""
    for text in arguments.robots:
        if text not in _NAMES:
            return checkpoint_task(split_robot(text)[1])
    for text in arguments.partners:
        if f"{PROXY}:" in text:
            named = parse_partners([text], get_task())[0]
            return checkpoint_task(named.detail)
    return get_task()


def _given(floor: str, robots: Sequence[str]) -> bool:
    return floor in robots or (floor == "nothing" and "passive" in robots)


def _require_names(names: Sequence[str]) -> None:
    """Checks the names of robots and of methods."""
    from .cells import OWN_KIND

    if len(set(names)) < len(names) or OWN_KIND in names:
        expected = f"robots and methods of different names (NAME=CKPT gives one), other than {OWN_KIND}"
        raise InvalidValueError("--robots", expected, names)


def _protocol(
    arguments: argparse.Namespace, robots: Sequence["StudyRobot"], named: Sequence[PartnerName]
) -> "Protocol":
    from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
    from copolicy.collect.agents.training_conditions import training_conditions

    policies = [(robot.name, robot.policy.conditions) for robot in robots if robot.policy is not None]
    for partner in named:
        if partner.kind == PROXY:
            conditions = training_conditions(checkpoint_folder(partner.detail))
            # --fps is the rate of the robots; a proxy keeps its own.
            policies.append((partner.name, replace(conditions, fps=arguments.fps or conditions.fps)))
    return study_protocol(arguments, policies)


def _run(
    arguments: argparse.Namespace,
    play: "Play",
    robots: Sequence["StudyRobot"],
    partners: Sequence["StudyPartner"],
) -> dict[str, dict[str, Any]]:
    """Cells by robot and partner; each partner's own kind first."""
    from .cells import OWN_KIND, own_kind_robot, run_cell

    cells: dict[str, dict[str, Any]] = {OWN_KIND: {}, **{robot.name: {} for robot in robots}}
    owned = sum(partner.own_kind is not None for partner in partners)
    with progress_bar(len(robots) * len(partners) + owned, "cells") as bar:
        for partner in partners:
            own = [] if partner.own_kind is None else [own_kind_robot(partner, arguments.repeats)]
            for robot in (*own, *robots):
                cells[robot.name][partner.name] = run_cell(
                    arguments.out, play, robot, partner, arguments.overwrite, arguments.trajectories
                )
                bar.update()
    return cells


def _write(out: Path, result: dict[str, Any]) -> dict[str, Any]:
    from .figure import save_heat_maps
    from .report import csv_text, markdown

    files = {suffix: out / f"matrix{suffix}" for suffix in (".json", ".md", ".csv", ".png")}
    settings = result["settings"]
    title = (
        f"cross-play on {settings['maps']}: {settings['episodes_per_cell']} episodes per cell, mean ± standard error, "
        "no person took part"
    )
    save_heat_maps(result, files[".png"], title)
    replace_text(files[".md"], markdown(result))
    replace_text(files[".csv"], csv_text(result))
    replace_json(files[".json"], result, indent=1)  # last, so that an existing result is complete
    scores = result["scores"].get("robots", {})
    return {
        "label": result["label"],
        "partner_score": {
            robot: _percent(score)
            + (f", first in {100 * score['first']:.0f} %" if "first" in score else "")
            + _yielding(result["gave_way"].get("robots", {}).get(robot))
            for robot, score in sorted(scores.items(), key=lambda item: -item[1]["mean"])
        },
        "result": str(files[".json"]),
        "table": str(files[".md"]),
        "figure": str(files[".png"]),
        **({"not_measured": result["not_measured"]} if result["not_measured"] else {}),
        **({"no_own_kind": result["no_own_kind"]} if result["no_own_kind"] else {}),
    }


def _yielding(found: dict[str, Any] | None) -> str:
    return "" if found is None else f", gave way {_percent(found)} (adaptations: {found['adaptations']})"


def _percent(score: dict[str, Any]) -> str:
    error = score["standard_error"]
    return f"{100 * score['mean']:.1f}" + ("" if error is None else f" ± {100 * error:.1f}") + " %"
