"""`copolicy-convert`: converts recordings and files of the original program to LeRobot v3; merges and exports these."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

from copolicy.dataset.clock import Downsampling
from copolicy.dataset.command_line.commands import add_command, command_parser, run
from copolicy.dataset.command_line.extras import DATASETS
from copolicy.dataset.command_line.flag_numbers import whole_number
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.features import SCENE_SIZE
from copolicy.dataset.publication.licences import checked_licence
from copolicy.dataset.publication.repo_id import checked_repo_id

from .export.command import add_export_command
from .lerobot.prepare import Conversion
from .merge.command import add_merge_command
from .recordings import convert_recordings
from .scale.command import add_scale_flags, convert_in_shards, scale_from_flags, shards_requested
from .upstream.build_episode import ANGULAR_LIMITS, UpstreamOptions
from .upstream.conversion import convert_upstream

_DEFAULT_FPS = 10


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command; returns the exit status."""
    return run(_parser(), argv)


def _parser() -> argparse.ArgumentParser:
    parser, commands = command_parser("copolicy-convert", "Make LeRobot v3 data sets, and export them.")
    mcap = add_command(
        commands, "mcap", _mcap, "convert recordings, one MCAP file per episode, to a LeRobot v3 data set",
        "copolicy-convert mcap recordings --out datasets/table --repo-id me/table",
        lambda arguments: (
            *DATASETS, *(("av",) if arguments.video else ()), *(("datatrove",) if shards_requested(arguments) else ())
        ),
    )  # fmt: skip
    mcap.add_argument("folders", nargs="+", type=Path, metavar="DIR", help="folders of recordings, or single files")
    _add_output_flags(mcap)
    mcap.add_argument(
        "--append", action="store_true",
        help="add new recordings to the data set at OUT, with its rate and downsampling, without rewriting its files",
    )  # fmt: skip
    mcap.add_argument("--keep-discarded", action="store_true", help="keep episodes that the operator discarded")
    mcap.add_argument("--no-drift", action="store_true", help="skip the re-simulation that fills replay_drift_px")
    mcap.add_argument(
        "--video", action="store_true", help="draw each frame as the video feature observation.images.scene (H.264)"
    )
    mcap.add_argument(
        "--video-size", metavar="WxH", help="video size in px (default: 600x300; with --append that of the data set)"
    )
    add_scale_flags(mcap)
    upstream = add_command(
        commands, "upstream", _upstream,
        "convert files of the original program (raw pickles, processed npz, or its 10 Hz zarr store)",
        "copolicy-convert upstream data/table/table_10Hz.zarr --out datasets/demonstrations --repo-id me/table",
        DATASETS,
    )  # fmt: skip
    upstream.add_argument("path", type=Path, metavar="PATH", help="folder of the files, or the store")
    _add_output_flags(upstream)
    upstream.add_argument(
        "--angular-limit", choices=("auto", *ANGULAR_LIMITS), default="auto",
        help="limit of the angular acceleration at recording, rad/s^2; auto estimates it for each episode",
    )  # fmt: skip
    upstream.add_argument(
        "--obstacle-size", type=whole_number("--obstacle-size", 1, 600), default=50, metavar="PX",
        help="side of the obstacles, which the files do not state (default: %(default)s, as in the training maps)",
    )  # fmt: skip
    add_merge_command(commands)
    add_export_command(commands)
    return parser


def _add_output_flags(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", type=Path, required=True, metavar="OUT", help="the data set's folder; must be new")
    parser.add_argument("--repo-id", required=True, metavar="USER/NAME", help="the data set's name on the Hub")
    parser.add_argument(
        "--fps",
        type=whole_number("--fps", None),
        help=f"frames per second, a divisor of the recording rate (table: 30; default: {_DEFAULT_FPS})",
    )
    parser.add_argument(
        "--downsampling", choices=get_args(Downsampling), default=None,
        help="action of a frame: the mean of its recorded steps or the first (default: mean; first for a zarr store)",
    )  # fmt: skip
    parser.add_argument(
        "--license",
        default="",
        metavar="ID",
        help="licence of episodes that state none: an identifier of the Hub, such as cc-by-4.0",
    )
    parser.add_argument(
        "--skip-damaged", action="store_true", help="skip damaged files and list them, instead of stopping"
    )


def _mcap(arguments: argparse.Namespace) -> dict[str, Any]:
    repo_id, licence = checked_repo_id(arguments.repo_id), checked_licence(arguments.license)
    fps, downsampling = _DEFAULT_FPS if arguments.fps is None else arguments.fps, arguments.downsampling or "mean"
    convert = convert_recordings
    if arguments.append:
        from .lerobot.append import append_recordings, stored_sampling

        fps, downsampling = stored_sampling(arguments.out, arguments.fps, arguments.downsampling)
        convert = append_recordings
    conversion = Conversion(
        fps,
        downsampling,
        licence,
        keep_discarded=arguments.keep_discarded,
        drift=not arguments.no_drift,
        video=_video(arguments),
    )
    scale = scale_from_flags(arguments)
    if scale is not None:
        return convert_in_shards(arguments.folders, arguments.out, repo_id, conversion, arguments.skip_damaged, scale)
    return convert(
        arguments.folders, arguments.out, repo_id, conversion, arguments.skip_damaged, arguments.workers or 1
    )


def _video(arguments: argparse.Namespace) -> tuple[int, int] | None:
    if arguments.video_size and not arguments.video:
        raise InvalidValueError("--video-size", "--video beside it", arguments.video_size)
    if not arguments.video and not arguments.append:
        return None
    from .video.scene_video import parse_size

    size = parse_size(arguments.video_size) if arguments.video_size else None
    if not arguments.append:
        return size or SCENE_SIZE
    from .lerobot.append import stored_video_size

    return stored_video_size(arguments.out, arguments.video, size)


def _upstream(arguments: argparse.Namespace) -> dict[str, Any]:
    return convert_upstream(
        arguments.path,
        arguments.out,
        checked_repo_id(arguments.repo_id),
        _DEFAULT_FPS if arguments.fps is None else arguments.fps,
        arguments.downsampling,
        UpstreamOptions(arguments.angular_limit, arguments.obstacle_size),
        checked_licence(arguments.license),
        arguments.skip_damaged,
    )
