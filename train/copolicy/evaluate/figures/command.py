"""`copolicy-eval figures`."""

import argparse
import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from copolicy.dataset.command_line.commands import Commands, add_command
from copolicy.dataset.command_line.extras import FIGURES
from copolicy.dataset.command_line.flag_numbers import add_whole_number
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.staging import require_new
from copolicy.dataset.task import PairTask
from copolicy.dataset.trajectory_figures import FIGURES_FILE, TrajectoryFigures

from ..trajectory_sources import SOURCE_HELP, Source, read_sources, require_map
from .faults import CONCERNS, SENTENCES, Faults

if TYPE_CHECKING:
    from matplotlib.figure import Figure

VISITATION, FORCE_MAP, FORCE_PATH, SUCCESS = NAMES = ("visitation", "force-map", "force-path", "success-by-map")
AS_PUBLISHED = "-as-published"


def add_figures_command(commands: Commands) -> None:
    """Adds `figures` to the commands of `copolicy-eval`."""
    command = add_command(
        commands,
        "figures",
        _figures,
        "visits, interaction maps, interaction along a path, and success by map, of several sources on common scales",
        "copolicy-eval figures people=outputs/dataset ours=outputs/eval.json --out outputs/figures",
        FIGURES,
    )
    command.add_argument("sources", nargs="+", metavar="NAME=SOURCE", help=SOURCE_HELP)
    command.add_argument(
        "--out",
        required=True,
        type=Path,
        metavar="FOLDER",
        help="folder of the figures (PNG and SVG) and of figures.json, which has their numbers",
    )
    command.add_argument("--only", nargs="+", choices=NAMES, help="draw only these figures (default: all)")
    command.add_argument(
        "--map", metavar="ID", help="use only the episodes on this map (its obstacles and goal, whatever the start)"
    )
    command.add_argument(
        "--episode",
        nargs="+",
        default=[],
        metavar="NAME=NUMBER",
        help="episode of a source in force-path: its index in the data set, or its place among the episodes of the "
        "robot in the study, from 0 (default: of each source the success of median force on a common map)",
    )
    add_whole_number(
        command, "--min-episodes", "least number of episodes in a cell of force-map that is shown (default: 3)", 3
    )
    faults = "; ".join(f"{name}: {text}" for name, text in SENTENCES.items())
    command.add_argument(
        "--as-published",
        nargs="*",
        metavar="FAULT",
        help="also draw the first three figures with the faults of the figure code released with the paper, all or "
        f"those named ({faults})",
    )
    command.add_argument("--overwrite", action="store_true", help="replace existing figures")


def _figures(arguments: argparse.Namespace) -> dict[str, Any]:
    faults = None if arguments.as_published is None else Faults.named(arguments.as_published)
    from .sheet import FORMATS, save_files

    names = [name for name in NAMES if arguments.only is None or name in arguments.only]
    every = [*names, *(f"{name}{AS_PUBLISHED}" for name in names if faults and name in CONCERNS)]
    files = [arguments.out / f"{name}.{ending}" for name in every for ending in FORMATS]
    if arguments.out.exists() and not arguments.out.is_dir():
        raise InvalidValueError("--out", "a folder", str(arguments.out))
    require_new(*files, arguments.out / FIGURES_FILE, overwrite=arguments.overwrite)
    task, sources = read_sources(arguments.sources)
    if arguments.map is not None:
        sources = require_map(task, sources, arguments.map)
    left_out = _left_out(task, names, faults)
    figures, described = _drawn(task, sources, [name for name in names if name not in left_out], arguments)
    if faults is not None:
        published = _drawn_as_published(task, sources, list(figures), arguments.episode, faults)
        figures |= published
        described |= {name: _described_faults(name, faults) for name in published}
    if not figures:
        raise InvalidValueError("--only", "a figure for which the task has the parts", left_out)
    document = {
        "figures": {
            name: {
                "title": figure.get_suptitle().replace("\n", " "),
                "files": [f"{name}.{ending}" for ending in FORMATS],
                **described[name],
            }
            for name, figure in figures.items()
        },
        "left_out": left_out,
        **({} if arguments.map is None else {"map": arguments.map}),
        **_described_sources(task, sources),
    }
    saved = save_files(arguments.out, figures, json.dumps(document, allow_nan=False) + "\n")
    return {
        "sources": {source.name: f"{len(source.episodes)} episodes, {source.label}" for source in sources},
        "figures": [str(arguments.out / file) for files in saved.values() for file in files],
        "numbers": str(arguments.out / FIGURES_FILE),
        **({"left_out": left_out} if left_out else {}),
    }


def conventions_of(task: PairTask) -> TrajectoryFigures:
    """Cell sizes and thresholds of a task; the task must have an outline."""
    width = task.required_outline.size[0]
    return task.studies.figures or TrajectoryFigures(visit_cell=width / 100, interaction_cell=width / 24)


def _left_out(task: PairTask, names: Sequence[str], faults: Faults | None) -> dict[str, str]:
    """The reason for each figure that the task lacks the parts of."""
    figures = task.studies.figures
    reasons = {}
    if task.outline is None:
        reasons = dict.fromkeys((VISITATION, FORCE_MAP, FORCE_PATH), task.missing("outline"))
    elif not task.offers("interaction"):
        reasons = dict.fromkeys((FORCE_MAP, FORCE_PATH), task.missing("interaction measure"))
    elif figures is None or not figures.thresholds:
        reasons = {FORCE_MAP: task.missing("thresholds of the interaction measure (`studies.figures`)")}
    reasons = {name: reason for name, reason in reasons.items() if name in names}
    if faults is not None and (figures is None or figures.published is None):
        reasons[AS_PUBLISHED.removeprefix("-")] = task.missing("published figures (`studies.figures`)")
    return reasons


def _drawn(
    task: PairTask, sources: Sequence[Source], names: Sequence[str], arguments: argparse.Namespace
) -> tuple[dict[str, "Figure"], dict[str, Any]]:
    from .episode_choice import chosen_episodes
    from .force_map import interaction_map
    from .force_path import force_path
    from .success_by_map import success_by_map
    from .visitation import visitation

    drawn: dict[str, tuple[Figure, Any]] = {}
    for name in names:
        if name == VISITATION:
            drawn[name] = visitation(task, conventions_of(task), sources)
        elif name == FORCE_MAP:
            drawn[name] = interaction_map(task, conventions_of(task), sources, arguments.min_episodes)
        elif name == FORCE_PATH:
            drawn[name] = force_path(task, *chosen_episodes(task, sources, arguments.episode))
        else:
            drawn[name] = success_by_map(task, sources)
    return {name: figure for name, (figure, _) in drawn.items()}, {
        name: numbers for name, (_, numbers) in drawn.items()
    }


def _drawn_as_published(
    task: PairTask, sources: Sequence[Source], names: Sequence[str], named_episodes: Sequence[str], faults: Faults
) -> dict[str, "Figure"]:
    from .episode_choice import chosen_episodes
    from .force_path import published_force_path
    from .published import published_interaction_map, published_visitation

    if task.outline is None or (published := conventions_of(task).published) is None:
        return {}
    drawn: dict[str, Figure] = {}
    for name in names:
        if name == VISITATION:
            drawn[name] = published_visitation(task, conventions_of(task), sources, faults)
        elif name == FORCE_MAP:
            drawn[name] = published_interaction_map(task, conventions_of(task), sources, faults)
        elif name == FORCE_PATH:
            chosen, _ = chosen_episodes(task, sources, named_episodes)
            drawn[name] = published_force_path(task, published, chosen, faults)
    return {f"{name}{AS_PUBLISHED}": figure for name, figure in drawn.items()}


def _described_faults(name: str, faults: Faults) -> dict[str, Any]:
    listed = {fault: SENTENCES[fault] for fault in faults.of(name.removesuffix(AS_PUBLISHED))}
    return {"definition": "as the figure code released with the paper draws it: no result", "faults": listed}


def _described_sources(task: PairTask, sources: Sequence[Source]) -> dict[str, Any]:
    from .samples import SAMPLING

    outline = task.outline
    scene = {} if outline is None else {"scene": {"size": list(outline.size), "unit": outline.unit, "y": "down"}}
    return {
        "task": task.spec.name,
        **scene,
        "sampling": SAMPLING,
        "sources": [
            {
                "name": source.name,
                "label": source.label,
                "path": source.path,
                "demonstrations": source.demonstrations,
                "episodes": len(source.episodes),
                "successes": source.successes,
                "fps": source.fps,
                **({} if outline is None else {"fixed": _fixed(task, source)}),
            }
            for source in sources
        ],
    }


def _fixed(task: PairTask, source: Source) -> list[dict[str, Any]]:
    """Each obstacle and goal of a source with the number of its episodes that have it."""
    shapes = Counter(
        shape
        for episode in source.episodes
        for shape in dict.fromkeys(task.required_outline.fixed(episode.scenario))
        if shape.role in ("obstacle", "goal")
    )
    return [
        {"role": shape.role, "corners": [list(corner) for corner in shape.corners], "episodes": count}
        for shape, count in shapes.items()
    ]
