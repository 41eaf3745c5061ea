"""`copolicy-eval behaviours`."""

import argparse
import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from copolicy.dataset.command_line.commands import Commands, add_command, progress
from copolicy.dataset.command_line.flag_numbers import seed
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.staging import replace_json, replace_text, require_new

from ..file_names import file_names
from ..markdown_table import markdown_table
from ..trajectory_sources import SOURCE_HELP, read_sources

if TYPE_CHECKING:
    from .definitions import Behaviour
    from .motion import Event, Motion

_FILES = ("behaviours.json", "behaviours.md", "behaviours.csv")


def add_behaviours_command(commands: Commands) -> None:
    """Adds `behaviours` to the commands of `copolicy-eval`."""
    command = add_command(
        commands,
        "behaviours",
        _behaviours,
        "count adaptation, leadership switches, passivity, pivots and dissent of methods, with null distributions",
        "copolicy-eval behaviours people=data/pairs ours=outputs/eval.json --out outputs/behaviours",
        lambda arguments: () if arguments.no_videos else ("PIL",),
    )
    command.add_argument("sources", nargs="+", metavar="[NAME=]SOURCE", help=SOURCE_HELP)
    command.add_argument("--out", required=True, type=Path, metavar="FOLDER", help="folder of the results and videos")
    command.add_argument("--no-videos", action="store_true", help="do not write the clearest instance of each as a GIF")
    command.add_argument("--seed", type=seed(), default=0, help="seed of the bootstrap and null draws (default: 0)")
    command.add_argument("--overwrite", action="store_true", help="replace an existing result")


def _behaviours(arguments: argparse.Namespace) -> dict[str, Any]:
    if arguments.out.exists() and not arguments.out.is_dir():
        raise InvalidValueError("--out", "a folder", str(arguments.out))
    files = [arguments.out / name for name in _FILES]
    require_new(*files, overwrite=arguments.overwrite)
    from .clips import write_clip  # pygame
    from .counts import INTERVALS, count, rate_text
    from .definitions import behaviours_of
    from .motion import Motion, common_rate

    task, sources = read_sources(arguments.sources)
    fps = common_rate(rate for source in sources for rate in source.fps)
    chosen = behaviours_of(task)
    counted = [behaviour for behaviour in chosen if not behaviour.missing]
    result: dict[str, Any] = {
        "study": "behaviours",
        "task": task.spec.name,
        "settings": {"fps": fps, "seed": arguments.seed, "unit_of_analysis": f"an episode; {INTERVALS}"},
        "definitions": {behaviour.name: behaviour.definition for behaviour in counted},
        "not_counted": {each.name: task.missing(each.missing) for each in chosen if each.missing},
        "methods": {},
    }
    arguments.out.mkdir(parents=True, exist_ok=True)
    videos: dict[str, str] = {}
    endings = file_names([source.name for source in sources])
    for source in progress(sources, len(sources), "methods"):
        motion, name = Motion(task, source.episodes, fps), source.name
        entry: dict[str, Any] = {"label": source.label, "episodes": len(source.episodes)}
        entry["minutes"] = round(float(motion.minutes.sum()), 3)
        for behaviour in counted:
            entry[behaviour.name], events = count(behaviour, motion, arguments.seed)
            if not events:
                continue
            entry[behaviour.name]["clearest"] = _described(motion, events[0])
            if not arguments.no_videos and task.outline is not None:
                video = arguments.out / f"{behaviour.name}-{endings[name]}.gif"
                title = f"{behaviour.name.replace('_', ' ')}, {name}"
                write_clip(video, task, source.episodes[events[0].episode], events[0], fps, title)
                videos[f"{behaviour.name}, {name}"] = str(video)
        result["methods"][name] = entry
    replace_text(files[1], _markdown(result, counted, task.spec.players))
    replace_text(files[2], _csv(result, counted))
    replace_json(files[0], result, indent=1)
    return {
        **{
            behaviour.name: {
                name: rate_text(entry[behaviour.name]["per_minute"]) for name, entry in result["methods"].items()
            }
            for behaviour in counted
        },
        "result": str(files[0]),
        "table": str(files[1]),
        **({"videos": len(videos)} if videos else {}),
        **({"not_counted": result["not_counted"]} if result["not_counted"] else {}),
    }


def _described(motion: "Motion", event: "Event") -> dict[str, Any]:
    columns = motion.trajectories[event.episode].columns
    named = {name: columns[name] for name in ("map_id", "partner", "repeat", "episode_uuid") if name in columns}
    fps = motion.frames.fps
    return {
        "episode": event.episode,
        **named,
        "from_s": event.first / fps,
        "to_s": event.end / fps,
        "score": round(event.score, 4),
        **event.details,
    }


def _markdown(result: Mapping[str, Any], counted: Sequence["Behaviour"], players: tuple[str, str]) -> str:
    from .counts import INTERVALS, rate_text

    methods = result["methods"]
    text = [f"Instances per minute, with 95 % interval, mean of the null distribution and p; {INTERVALS}:"]
    rows = [
        [behaviour.name, *(rate_text(entry[behaviour.name]["per_minute"]) for entry in methods.values())]
        for behaviour in counted
    ]
    text.append(markdown_table(["behaviour", *methods], rows))
    rows = [
        [
            behaviour.name,
            *(f"{100 * (entry[behaviour.name]['episodes']['value'] or 0):.1f} %" for entry in methods.values()),
        ]
        for behaviour in counted
    ]
    text.append("Episodes with at least one:\n\n" + markdown_table(["behaviour", *methods], rows))
    if any(behaviour.name == "adaptation" for behaviour in counted):
        everyone = (*players, " and ".join(players))
        rows = [[name, *(_gave_way(entry["adaptation"], who) for who in everyone)] for name, entry in methods.items()]
        text.append("Who gave way in adaptations:\n\n" + markdown_table(["method", *everyone], rows))
    text.append(
        "\n".join(f"- {name}: {entry['label']}; {entry['episodes']} episodes." for name, entry in methods.items())
    )
    notes = {**result["definitions"], **result["not_counted"]}
    text.append("\n".join(f"- {name}: {note}" for name, note in notes.items()))
    return "\n\n".join(text) + "\n"


def _gave_way(entry: Mapping[str, Any], who: str) -> str:
    return str(entry.get("details", {}).get("gave_way", {}).get(who, 0))


def _csv(result: Mapping[str, Any], counted: Sequence["Behaviour"]) -> str:
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(
        ["method", "behaviour", "number", "per_minute", "low", "high", "null_mean", "p", "episodes_with_one"]
    )
    for name, entry in result["methods"].items():
        for behaviour in counted:
            found = entry[behaviour.name]
            rate, null = found["per_minute"], found["per_minute"].get("null") or {}
            low, high = rate["interval"] or ("", "")
            row = [
                name,
                behaviour.name,
                found["number"],
                rate["value"],
                low,
                high,
                null.get("mean", ""),
                null.get("p", ""),
            ]
            writer.writerow([*row, found["episodes"]["value"]])
    return buffer.getvalue()
