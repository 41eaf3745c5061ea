"""The flags of `copolicy-collect replay`."""

import argparse
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import add_command
from copolicy.dataset.command_line.flag_numbers import number, whole_number
from copolicy.dataset.exceptions import InvalidValueError

from ..angular_limit import ANGULAR_LIMITS

_VIEWER = Path()  # `--rerun` without a file


def add_replay_command(commands: argparse._SubParsersAction) -> None:
    """Adds `replay` to the commands of `copolicy-collect`."""
    command = add_command(
        commands,
        "replay",
        _replay,
        help="show a recording in a window, write it as video, GIF or contact sheet, or verify it",
        example="copolicy-collect replay recordings/P01-01/episode_000.mcap\n"
        "  copolicy-collect replay episode_000.mcap --video episode.mp4 --speed 2\n"
        "  copolicy-collect replay episode_000.mcap --verify",
        needs=lambda arguments: ("PIL",) if arguments.gif else (),
    )
    command.add_argument("file", type=Path, help="a recording, NAME.mcap")
    command.add_argument("--video", type=Path, metavar="OUT.mp4", help="write an H.264 video; needs no display")
    command.add_argument("--gif", type=Path, metavar="OUT.gif", help="write a looping GIF; needs no display")
    command.add_argument("--png", type=Path, metavar="OUT.png", help="write a contact sheet; needs no display")
    command.add_argument(
        "--rerun",
        type=Path,
        nargs="?",
        const=_VIEWER,
        metavar="OUT.rrd",
        help="open the recording in Rerun, or write a Rerun file (pip install rerun-sdk)",
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
        "--limit-px",
        type=number("--limit-px", above=True),
        help="for --verify: largest position drift, px (default 0.01)",
    )
    command.add_argument(
        "--limit-rad",
        type=number("--limit-rad", above=True),
        help="for --verify: largest orientation drift, rad (default 0.0001)",
    )


def _replay(arguments: argparse.Namespace) -> dict[str, Any]:
    # Imported here, since pygame is slow to import and `--help` does not need it.
    from .rerun_log import log_to_rerun, require_rerun
    from .sheet import write_sheet
    from .track import read_track
    from .verify import verify
    from .video import video_encoder, write_gif, write_video

    if arguments.video:
        video_encoder()
    if arguments.rerun is not None:
        require_rerun()
    track = read_track(arguments.file)
    if not track.steps:
        raise InvalidValueError(str(arguments.file), "a recording of at least one step", 0)
    summary: dict[str, Any] = {}
    options = {"speed": arguments.speed, "width": arguments.width, "fps": arguments.fps}
    if arguments.verify:
        summary["verify"] = verify(track, arguments.angular_limit, arguments.limit_px, arguments.limit_rad)
        summary["exit_status"] = summary["verify"].pop("exit_status")
    if arguments.video:
        summary["video"] = write_video(track, arguments.video, **options)
    if arguments.gif:
        summary["gif"] = write_gif(track, arguments.gif, **options)
    if arguments.png:
        sheet = {} if arguments.width is None else {"width": arguments.width}
        summary["png"] = write_sheet(track, arguments.png, arguments.frames, **sheet)
    if arguments.rerun is not None:
        summary["rerun"] = log_to_rerun(track, None if arguments.rerun == _VIEWER else arguments.rerun)
    if not summary:
        from .viewer import Viewer

        Viewer(track).run()
        summary = {"file": str(arguments.file), "steps": track.steps}
    return summary
