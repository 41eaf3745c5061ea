"""The flags of `copolicy-collect replay`."""

import argparse
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import Commands, add_command
from copolicy.dataset.command_line.flag_numbers import number, whole_number
from copolicy.dataset.exceptions import InvalidValueError

from ..angular_limit import ANGULAR_LIMITS

_FORMATS = {".mp4": "video", ".mkv": "video", ".gif": "gif", ".png": "png", ".rrd": "rerun"}  # by suffix


def add_replay_command(commands: Commands) -> None:
    """Adds `replay` to the commands of `copolicy-collect`."""
    command = add_command(
        commands,
        "replay",
        _replay,
        help="show a recording in a window, write it as video, GIF or contact sheet, or verify it",
        example="copolicy-collect replay recordings/P01-01/episode_000.mcap\n"
        "  copolicy-collect replay episode_000.mcap --out episode.mp4 --speed 2\n"
        "  copolicy-collect replay episode_000.mcap --verify",
        needs=lambda arguments: ("PIL",) if any(_format(path) == "gif" for path in arguments.out) else (),
    )
    command.add_argument("file", type=Path, help="a recording, NAME.mcap")
    command.add_argument(
        "--out",
        type=Path,
        nargs="+",
        action="extend",
        default=[],
        metavar="FILE",
        help="files to write, by suffix: .mp4 H.264 video, .gif looping GIF, .png contact sheet, .rrd Rerun file (pip "
        "install rerun-sdk); needs no display",
    )
    command.add_argument(
        "--rerun", action="store_true", help="open the recording in Rerun's viewer (pip install rerun-sdk)"
    )
    command.add_argument(
        "--verify",
        action="store_true",
        help="simulate the recorded actions again; exit status 1 if the states or the end differ",
    )
    command.add_argument(
        "--speed", type=number("--speed", 0.05, 100), default=1.0, help="of video and GIF, times real time (default 1)"
    )
    command.add_argument(
        "--fps", type=whole_number("--fps", 1, 120), help="frames per second (default: video 30, GIF 12)"
    )
    command.add_argument(
        "--width",
        type=whole_number("--width", 200, 10_000),
        help="width in px (default: video 1200, GIF 600, sheet 1800)",
    )
    command.add_argument(
        "--frames", type=whole_number("--frames", 1, 200), default=12, help="number of frames on the sheet (default 12)"
    )
    command.add_argument(
        "--angular-limit",
        choices=ANGULAR_LIMITS,
        help="for --verify: bound on the angular acceleration, instead of the recording's",
    )
    command.add_argument(
        "--max-drift-px",
        type=number("--max-drift-px", exclusive=True),
        help="for --verify: largest position drift, px (default 0.01)",
    )
    command.add_argument(
        "--max-drift-rad",
        type=number("--max-drift-rad", exclusive=True),
        help="for --verify: largest orientation drift, rad (default 0.0001)",
    )


def _replay(arguments: argparse.Namespace) -> dict[str, Any]:
    # Imported here, since pygame is slow to import and `--help` does not need it.
    from .rerun_log import log_to_rerun, require_rerun
    from .sheet import write_sheet
    from .track import read_track
    from .verify import verify
    from .video import video_encoder, write_gif, write_video

    formats = [_format(path) for path in arguments.out]
    if len({*formats}) < len(formats):
        raise InvalidValueError("--out", "one file of each kind", " ".join(map(str, arguments.out)))
    if "video" in formats:
        video_encoder()
    if arguments.rerun or "rerun" in formats:
        require_rerun()
    track = read_track(arguments.file)
    if not track.steps:
        raise InvalidValueError(str(arguments.file), "a recording of at least one step", 0)
    summary: dict[str, Any] = {}
    options = {"speed": arguments.speed, "width": arguments.width, "fps": arguments.fps}
    if arguments.verify:
        summary["verify"] = verify(track, arguments.angular_limit, arguments.max_drift_px, arguments.max_drift_rad)
        summary["exit_status"] = summary["verify"].pop("exit_status")
    sheet = {} if arguments.width is None else {"width": arguments.width}
    for name, path in zip(formats, arguments.out, strict=True):
        if name == "video":
            summary[name] = write_video(track, path, **options)
        elif name == "gif":
            summary[name] = write_gif(track, path, **options)
        elif name == "png":
            summary[name] = write_sheet(track, path, arguments.frames, **sheet)
        else:
            summary[name] = log_to_rerun(track, path)
    if arguments.rerun:
        summary["viewer"] = log_to_rerun(track)
    if not summary:
        from .viewer import Viewer

        Viewer(track).run()
        summary = {"file": str(arguments.file), "steps": track.steps}
    return summary


def _format(path: Path) -> str:
    """Returns the output format of a file, by its suffix.

    Raises:
        InvalidValueError: the suffix is unknown.
    """
    try:
        return _FORMATS[path.suffix.lower()]
    except KeyError:
        raise InvalidValueError("--out", f"names that end with {', '.join(_FORMATS)}", str(path)) from None
