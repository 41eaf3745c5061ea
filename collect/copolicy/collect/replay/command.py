"""The flags of `copolicy-collect replay`."""

import argparse
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import add_command
from copolicy.dataset.command_line.flag_numbers import number, whole_number
from copolicy.dataset.exceptions import InvalidValueError

from ..angular_limit import ANGULAR_LIMITS

_KINDS = {".mp4": "video", ".mkv": "video", ".gif": "gif", ".png": "png", ".rrd": "rerun"}  # by the name's ending


def add_replay_command(commands: argparse._SubParsersAction) -> None:
    """Adds `replay` to the commands of `copolicy-collect`."""
    command = add_command(
        commands,
        "replay",
        _replay,
        help="play a recording in a window, or write it as video, GIF or a sheet of images, or check it",
        example="copolicy-collect replay recordings/P01-01/episode_000.mcap\n"
        "  copolicy-collect replay episode_000.mcap --out episode.mp4 --speed 2\n"
        "  copolicy-collect replay episode_000.mcap --verify",
        needs=lambda arguments: ("PIL",) if any(_kind(path) == "gif" for path in arguments.out) else (),
    )
    command.add_argument("file", type=Path, help="a recording, NAME.mcap")
    command.add_argument(
        "--out",
        type=Path,
        nargs="+",
        default=(),
        metavar="FILE",
        help="write, by the ending of the name: .mp4 an H.264 video, .gif an endless GIF, .png a sheet of images, .rrd "
        "a file for Rerun (pip install rerun-sdk); needs no display",
    )
    command.add_argument("--rerun", action="store_true", help="open it in Rerun's viewer (pip install rerun-sdk)")
    command.add_argument(
        "--verify", action="store_true", help="simulate the actions again; exit status 1 where they lead elsewhere"
    )
    command.add_argument(
        "--speed", type=number("--speed", 0.05, 100), default=1.0, help="of video and GIF, times real time (default 1)"
    )
    command.add_argument(
        "--fps", type=whole_number("--fps", 1, 120), help="frames a second (default: video 30, GIF 12)"
    )
    command.add_argument(
        "--width", type=whole_number("--width", 200, 10_000), help="px (default: video 1200, GIF 600, sheet 1800)"
    )
    command.add_argument(
        "--frames", type=whole_number("--frames", 1, 200), default=12, help="images on the sheet (default 12)"
    )
    command.add_argument(
        "--angular-limit",
        choices=ANGULAR_LIMITS,
        help="of --verify: another bound on the angular acceleration than the recording states",
    )
    command.add_argument(
        "--max-drift-px",
        type=number("--max-drift-px", exclusive=True),
        help="of --verify: largest drift, px (default 0.01)",
    )
    command.add_argument(
        "--max-drift-rad",
        type=number("--max-drift-rad", exclusive=True),
        help="of --verify: the same, rad (default 0.0001)",
    )


def _replay(arguments: argparse.Namespace) -> dict[str, Any]:
    # Loading pygame takes a moment that `--help` should not.
    from .film import video_encoder, write_gif, write_video
    from .rerun_log import log_to_rerun, require_rerun
    from .sheet import write_sheet
    from .track import read_track
    from .verify import verify

    kinds = [_kind(path) for path in arguments.out]
    if len({*kinds}) < len(kinds):
        raise InvalidValueError("--out", "one file of each kind", " ".join(map(str, arguments.out)))
    if "video" in kinds:
        video_encoder()
    if arguments.rerun or "rerun" in kinds:
        require_rerun()
    track = read_track(arguments.file)
    if not track.steps:
        raise InvalidValueError(str(arguments.file), "a recording of at least one step", 0)
    summary: dict[str, Any] = {}
    film = {"speed": arguments.speed, "width": arguments.width, "fps": arguments.fps}
    if arguments.verify:
        summary["verify"] = verify(track, arguments.angular_limit, arguments.max_drift_px, arguments.max_drift_rad)
        summary["exit_status"] = summary["verify"].pop("exit_status")
    sheet = {} if arguments.width is None else {"width": arguments.width}
    for kind, path in zip(kinds, arguments.out, strict=True):
        if kind == "video":
            summary[kind] = write_video(track, path, **film)
        elif kind == "gif":
            summary[kind] = write_gif(track, path, **film)
        elif kind == "png":
            summary[kind] = write_sheet(track, path, arguments.frames, **sheet)
        else:
            summary[kind] = log_to_rerun(track, path)
    if arguments.rerun:
        summary["viewer"] = log_to_rerun(track)
    if not summary:
        from .viewer import Viewer

        Viewer(track).run()
        summary = {"file": str(arguments.file), "steps": track.steps}
    return summary


def _kind(path: Path) -> str:
    """What is written under a name, by its ending.

    Raises:
        InvalidValueError: an ending of no kind.
    """
    try:
        return _KINDS[path.suffix.lower()]
    except KeyError:
        raise InvalidValueError("--out", f"names that end with {', '.join(_KINDS)}", str(path)) from None
