"""A replay in Rerun: body, forces, trails and interaction measure on the timeline `sim_time`."""

import importlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.exceptions import CopolicyError, InvalidValueError, RunError
from copolicy.dataset.files.staging import new_file, require_new
from copolicy.dataset.outline import Point, Shape, to_scene
from copolicy.dataset.task_spec import PLAYERS

from ..screen.palette import GREEN, OBSTACLE, SEATS, WOOD, mix
from .track import Track

_TIMELINE = "sim_time"
_WIDTH = 1200.0  # width of a scene in which line radii are as given below
_GRAY = (128, 128, 128)
_COLOURS = {
    "window": _GRAY,
    "goal": GREEN,
    "obstacle": mix(OBSTACLE, _GRAY, 0.5),
    "robot": SEATS[0],
    "human": SEATS[1],
}


def require_rerun() -> tuple[Any, Any]:
    """Imports the modules `rerun` and `rerun.blueprint`.

    Raises:
        CopolicyError: rerun-sdk is not installed.
    """
    try:
        return importlib.import_module("rerun"), importlib.import_module("rerun.blueprint")
    except ImportError:
        raise CopolicyError("Rerun: expected the package rerun-sdk, found none: pip install rerun-sdk") from None


def log_to_rerun(track: Track, path: Path | None = None) -> dict[str, Any]:
    """Opens a track in Rerun's viewer, or writes it to a file.

    Args:
        track: to show.
        path: of the file, `.rrd`; None opens the viewer.

    Returns:
        File or viewer, and number of steps, JSON-able.

    Raises:
        CopolicyError: rerun-sdk is not installed, or the task has no outline.
        OutputExistsError: the file exists.
        InvalidValueError: the suffix is not `.rrd`.
        RunError: the viewer has no display, or Rerun could not write the file, which is then removed.
    """
    if path is not None:
        if path.suffix.lower() != ".rrd":
            raise InvalidValueError(str(path), "a name that ends with .rrd", path.suffix)
        require_new(path)
    rr, blueprint = require_rerun()
    track.task.required_outline  # noqa: B018 (raises without one, before anything is opened)
    if (
        path is None
        and sys.platform == "linux"
        and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    ):
        # The viewer is a separate process, whose error message would not be shown.
        raise RunError(
            "expected a display (or a file, --out OUT.rrd), found none: neither DISPLAY nor WAYLAND_DISPLAY is set"
        )
    below = blueprint.TextLogView(origin="events", name="Events")
    if track.interaction is not None:
        graph = blueprint.TimeSeriesView(origin="interaction_force", name=track.task.words.interaction.capitalize())
        below = blueprint.Horizontal(graph, below, column_shares=[3, 1])
    scene = blueprint.Spatial2DView(origin="world", name=track.task.spec.name.capitalize())
    layout = blueprint.Blueprint(
        blueprint.Vertical(scene, below, row_shares=[2, 1]), blueprint.TimePanel(timeline=_TIMELINE)
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
        except RuntimeError as error:  # Rerun's; it omits the system's error, such as a full disk
            raise RunError(f"{path}: expected Rerun to write the file, found {' '.join(str(error).split())}") from None
        recording.disconnect()
    return {"out": str(path), "bytes": path.stat().st_size, "steps": track.steps}


def _log_track(rr: Any, recording: Any, track: Track) -> None:
    _log_scene(rr, recording, track)
    for step in progress(range(track.steps + 1), track.steps + 1, "steps"):
        recording.set_time(_TIMELINE, duration=step / track.hz)
        recording.set_time("step", sequence=step)
        _log_step(rr, recording, track, step)
    recording.flush()


def _log_scene(rr: Any, recording: Any, track: Track) -> None:
    """Logs the fixed shapes, the trails and a description of the episode."""
    outline, meta = track.task.required_outline, track.episode.meta
    width, height = outline.size
    window = Shape("window", ((0.0, 0.0), (width, 0.0), (width, height), (0.0, height)))
    shapes = (window, *outline.fixed(track.episode.scenario))
    for role, entity in (("window", "window"), ("goal", "goal"), ("obstacle", "obstacles")):
        strips = [_closed(shape.corners) for shape in shapes if shape.role == role]
        if strips:
            labels = {"labels": ["goal"] * len(strips)} if role == "goal" else {}
            lines = rr.LineStrips2D(strips, colors=[_COLOURS[role]] * len(strips), **labels)
            recording.log(f"world/{entity}", lines, static=True)
    for player, hand, colour in zip(PLAYERS, outline.hands, SEATS, strict=True):
        points = [to_scene(pose, hand) for pose in track.poses]
        trail = rr.LineStrips2D([points], colors=[mix(colour, _GRAY, 0.5)], radii=[width / _WIDTH])
        recording.log(f"world/trail/{player}", trail, static=True)
    if track.interaction is not None:
        senses = track.task.words.interaction_senses
        recording.log("interaction_force", rr.SeriesLines(names=[f"positive: {senses[0]}"]), static=True)
    lines = [f"**{track.path.name}**", meta.map_id, meta.pair_id, meta.termination_reason, meta.quality_flags]
    lines += [track.task.missing("interaction measure")] if track.interaction is None else []
    recording.log("about", rr.TextDocument("\n\n".join(line for line in lines if line)), static=True)


def _log_step(rr: Any, recording: Any, track: Track, step: int) -> None:
    outline, pose, forces = track.task.required_outline, track.poses[step], track.forces_at(step)
    radius = outline.size[0] / _WIDTH
    strips = [_closed([to_scene(pose, corner) for corner in shape.corners]) for shape in outline.body]
    colours = [_COLOURS.get(shape.role, WOOD) for shape in outline.body]
    recording.log(f"world/{track.task.spec.name}", rr.LineStrips2D(strips, colors=colours, radii=[2.0 * radius]))
    origins = [to_scene(pose, hand) for hand in outline.hands]
    vectors = [(outline.arrow * x, outline.arrow * y) for x, y in (forces[:2], forces[2:])]
    recording.log(
        "world/forces", rr.Arrows2D(origins=origins, vectors=vectors, colors=list(SEATS), radii=[2.5 * radius])
    )
    if step < track.steps and track.interaction is not None:
        recording.log("interaction_force", rr.Scalars([float(track.interaction[step])]))
    for event in track.events:
        if min(event.step, track.steps) == step:
            recording.log("events", rr.TextLog(f"{event.kind} {event.detail}".strip()))


def _closed(corners: Sequence[Point]) -> list[Point]:
    return [*corners, corners[0]]
