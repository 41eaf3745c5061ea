"""A replay in Rerun: table, forces, trails and interaction force on the timeline `sim_time`."""

import importlib
import math
import os
import sys
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.exceptions import CopolicyError, InvalidValueError, RunError
from copolicy.dataset.files.staging import new_file, require_new
from copolicy.dataset.outline import placed
from copolicy.dataset.task_spec import PLAYERS, RECORD_HZ
from copolicy.tasks.table.map_config import WINDOW
from copolicy.tasks.table.outline import CIRCLE_CENTRE, CIRCLE_RADIUS, TRIANGLE
from copolicy.tasks.table.physics import GOAL_SIZE
from copolicy.tasks.table.scene_outline import TableOutline, board_outline

from ..screen.palette import GREEN, OBSTACLE, SEATS, WOOD, mix
from .track import Pose, Track

_TIMELINE = "sim_time"
_FORCE_LENGTH = 95.0  # px, of a full force
_GRAY = (128, 128, 128)
_CIRCLE = [
    (
        CIRCLE_CENTRE[0] + CIRCLE_RADIUS * math.cos(k * math.pi / 12),
        CIRCLE_CENTRE[1] + CIRCLE_RADIUS * math.sin(k * math.pi / 12),
    )
    for k in range(25)
]


def require_rerun() -> tuple[Any, Any]:
    """Rerun and its blueprints.

    Raises:
        CopolicyError: rerun-sdk is not installed.
    """
    try:
        return importlib.import_module("rerun"), importlib.import_module("rerun.blueprint")
    except ImportError:
        raise CopolicyError("--rerun: expected the package rerun-sdk, found none: pip install rerun-sdk") from None


def log_to_rerun(track: Track, path: Path | None = None) -> dict[str, Any]:
    """Opens a track in Rerun's viewer, or writes a file for it.

    Args:
        track: what to show.
        path: of the file, `.rrd`; None opens the viewer.

    Returns:
        Where it went, JSON-able.

    Raises:
        CopolicyError: rerun-sdk is not installed.
        OutputExistsError: the file exists.
        InvalidValueError: another ending than `.rrd`.
        RunError: there is no display for the viewer, or Rerun could not write the file; nothing is left of it.
    """
    if path is not None:
        if path.suffix.lower() != ".rrd":
            raise InvalidValueError(str(path), "a name that ends with .rrd", path.suffix)
        require_new(path)
    rr, blueprint = require_rerun()
    if (
        path is None
        and sys.platform == "linux"
        and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    ):
        # The viewer is a program of its own, whose complaint nobody would see.
        raise RunError(
            "expected a display (or a file, --rerun OUT.rrd), found none: neither DISPLAY nor WAYLAND_DISPLAY is set"
        )
    layout = blueprint.Blueprint(
        blueprint.Vertical(
            blueprint.Spatial2DView(origin="world", name="Table"),
            blueprint.Horizontal(
                blueprint.TimeSeriesView(origin="interaction_force", name="Interaction force"),
                blueprint.TextLogView(origin="events", name="Events"),
                column_shares=[3, 1],
            ),
            row_shares=[2, 1],
        ),
        blueprint.TimePanel(timeline=_TIMELINE),
    )
    recording = rr.RecordingStream("copolicy", recording_id=track.episode.meta.source_sha256 or None)
    if path is None:
        recording.spawn(default_blueprint=layout)
        _log_track(rr, recording, track)
        return {"viewer": "opened", "steps": track.steps}
    with new_file(path) as partial:
        recording.save(str(partial), default_blueprint=layout)
        try:
            _log_track(rr, recording, track)
        except RuntimeError as error:  # Rerun's, which does not say what the system said, such as that the disk is full
            raise RunError(f"{path}: expected Rerun to write the file, found {' '.join(str(error).split())}") from None
        recording.disconnect()
    return {"out": str(path), "bytes": path.stat().st_size, "steps": track.steps}


def _log_track(rr: Any, recording: Any, track: Track) -> None:
    _log_map(rr, recording, track)
    for step in progress(range(track.steps + 1), track.steps + 1, "steps"):
        recording.set_time(_TIMELINE, duration=step / RECORD_HZ)
        recording.set_time("step", sequence=step)
        _log_step(rr, recording, track, step)
    recording.flush()


def _log_map(rr: Any, recording: Any, track: Track) -> None:
    """What stands still."""
    config, meta = track.episode.map_config, track.episode.meta
    width, height = WINDOW
    border = rr.Boxes2D(centers=[(width / 2, height / 2)], sizes=[WINDOW], colors=[_GRAY])
    recording.log("world/window", border, static=True)
    goal = rr.Boxes2D(centers=[config.goal], sizes=[(GOAL_SIZE, GOAL_SIZE)], colors=[GREEN], labels=["goal"])
    recording.log("world/goal", goal, static=True)
    if config.obstacles:
        sizes = [(size, size) for size in config.sizes]
        obstacles = rr.Boxes2D(centers=list(config.obstacles), sizes=sizes, colors=[mix(OBSTACLE, _GRAY, 0.5)])
        recording.log("world/obstacles", obstacles, static=True)
    for player, colour in zip(PLAYERS, SEATS, strict=True):
        points = [placed(pose, TableOutline.hands[PLAYERS.index(player)]) for pose in track.poses]
        trail = rr.LineStrips2D([points], colors=[mix(colour, _GRAY, 0.5)], radii=[1.0])
        recording.log(f"world/trail/{player}", trail, static=True)
    recording.log("interaction_force", rr.SeriesLines(names=["positive: pulling apart"]), static=True)
    lines = [f"**{track.path.name}**", meta.map_id, meta.pair_id, meta.termination_reason, meta.quality_flags]
    recording.log("about", rr.TextDocument("\n\n".join(line for line in lines if line)), static=True)


def _log_step(rr: Any, recording: Any, track: Track, step: int) -> None:
    pose = track.poses[step]
    outlines = [board_outline(), list(TRIANGLE), _CIRCLE]
    strips = [_closed(pose, outline) for outline in outlines]
    recording.log("world/table", rr.LineStrips2D(strips, colors=[WOOD, *SEATS], radii=[2.0]))
    fx0, fy0, fx1, fy1 = track.forces_at(step)
    origins = [placed(pose, point) for point in TableOutline.hands]
    vectors = [(_FORCE_LENGTH * fx0, _FORCE_LENGTH * fy0), (_FORCE_LENGTH * fx1, _FORCE_LENGTH * fy1)]
    recording.log("world/forces", rr.Arrows2D(origins=origins, vectors=vectors, colors=list(SEATS), radii=[2.5]))
    if step < track.steps:
        recording.log("interaction_force", rr.Scalars([track.interaction_at(step)]))
    for moment in track.moments:
        if min(moment.step, track.steps) == step:
            recording.log("events", rr.TextLog(f"{moment.kind} {moment.detail}".strip()))


def _closed(pose: Pose, outline: list[tuple[float, float]]) -> list[tuple[float, float]]:
    return [placed(pose, point) for point in (*outline, outline[0])]
