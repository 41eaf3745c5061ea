"""Builds the data of the page: episodes as JSON, frames as 16-bit integers in base64, and the words of the task."""

import base64
import math
from collections.abc import Iterable
from dataclasses import asdict
from importlib.metadata import version
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.episode import EPISODE_COLUMNS
from copolicy.dataset.outline import Outline, Shape
from copolicy.dataset.outline_figure import (
    BLUE,
    FAILURE,
    GOAL,
    HUMAN,
    ORANGE,
    ROBOT,
    decimals,
    label_colours,
    obstacles_of,
    positions_text,
)
from copolicy.dataset.task_spec import TIMEOUT

from ..artefacts import StoredFindings, estimates, stale_statistics_reason
from ..dataset_card import source_text
from ..episode_frames import EpisodeFrames, read_frames
from ..facts import DatasetFacts
from ..formatting import missing_part_note
from ..route_statistics import route_statistics

FRAME_SCALES = {
    "x": 20, "y": 20, "theta": 10_000,
    "robot_fx": 32_000, "robot_fy": 32_000, "human_fx": 32_000, "human_fy": 32_000, "interaction": 20_000,
}  # fmt: skip
"""Integers per unit of each column, for a scene of 1,200 px: a step is 0.05 px, 0.1 mrad, 1/32,000 of a force."""

FRAME_BYTES = 6_000_000
"""Limit of the size of the frames; a larger data set shows every second, third, ... frame."""

_SCENE = 1200
_LARGEST = 32_767
_COLUMNS = (*(name for name in EPISODE_COLUMNS if name != "physics"), "episode_index", "length")


def build_payload(
    facts: DatasetFacts,
    title: str,
    findings: StoredFindings | None = None,
    statistics: dict[str, Any] | None = None,
    frame_bytes: int = FRAME_BYTES,
) -> dict[str, Any]:
    """Builds the data of the page, JSON-able; numbers that are not finite become null.

    Args:
        findings: stored findings of `copolicy-dataset check`, None if it was not run.
        statistics: output of `copolicy-dataset stats`, None if it was not run.

    Raises:
        FileFormatError: the frames cannot be read.
    """
    outline, spec, words = facts.task.outline, facts.task.spec, facts.words
    step = max(1, math.ceil(facts.info["total_frames"] * 2 * len(FRAME_SCALES) / frame_bytes))
    missing = {} if outline else {"outline": missing_part_note(facts.task, "outline")}
    if not facts.task.offers("strategy"):
        missing["labels"] = missing_part_note(facts.task, "strategy labels")
    blocks: list[Array] = []
    rows: list[dict[str, Any]] = []
    scenes: dict[tuple[Shape, ...], int] = {}
    start = 0
    for episode, frames in zip(facts.episodes, read_frames(facts), strict=True):
        interaction = frames.interaction
        block = _block(frames, outline, interaction)[::step]
        row = {name: _finite(episode[name]) for name in _COLUMNS} | {"from": start, "frames": len(block)}
        if outline is not None:
            row["scene"] = scenes.setdefault(outline.fixed(frames.scenario), len(scenes))
        if interaction is not None:
            magnitude = np.abs(interaction)
            row |= {"force_mean": float(magnitude.mean()), "force_p95": float(np.quantile(magnitude, 0.95))}
        elif not rows:
            missing["interaction"] = missing_part_note(facts.task, "interaction measure")
        if not rows and facts.task.path(frames.states) is None:
            missing["drift"] = missing_part_note(facts.task, "tracked point")
        rows.append(row)
        blocks.append(block)
        start += len(block)
    routes = None if statistics is None else route_statistics(statistics)
    labels = {label for entry in (routes.configurations if routes else ()) for label in entry["counts"]}
    labels |= set(facts.counts("route_class"))
    scales, integers = _quantised(np.concatenate(blocks), outline, "interaction" not in missing)
    return {
        "title": title,
        "software": f"copolicy {version('lerobot_policy_copolicy')}",
        "format": facts.info["codebase_version"],
        "fps": facts.info["fps"],
        "record_hz": spec.record_hz,
        "frame_step": step,
        "words": asdict(words),
        "left_out": missing,
        "sources": {source: source_text(source, words, page=True) for source in facts.counts("source")},
        "successes": spec.successes,
        "failures": [reason for reason in spec.reasons if reason not in (*spec.successes, TIMEOUT)],
        "sides": all(set(label) <= {"L", "R"} for label in labels),
        "colours": {
            "labels": {label: label_colour for label, label_colour in label_colours(labels).items() if label},
            "seats": [ROBOT, HUMAN], "sides": [BLUE, ORANGE], "goal": GOAL, "failure": FAILURE,
        },
        "outline": None if outline is None else _outline_data(outline),
        "scenes": [] if outline is None else _scenes(outline, scenes),
        "scales": scales,
        "episodes": rows,
        "frames": base64.b64encode(integers.astype("<i2").tobytes()).decode(),
        "check": None if findings is None else _check(findings),
        "statistics": None if statistics is None else estimates(statistics),
        "statistics_doubt": stale_statistics_reason(statistics or {}, len(facts.episodes)),
        "routes": None if routes is None else routes.to_json(),
    }  # fmt: skip


def _check(findings: StoredFindings) -> dict[str, Any]:
    """The part of the findings that the page shows, without the limits and names of all rules."""
    shown = {name: findings.document.get(name) for name in ("date", "rules_version", "rules", "findings")}
    return {**shown, "state": findings.validity.state, "reason": findings.validity.reason}


def _outline_data(outline: Outline) -> dict[str, Any]:
    """The outline without its shapes that differ between episodes."""
    body = [_polygon(outline, shape) for shape in outline.body]
    fields = {name: getattr(outline, name) for name in ("size", "unit", "arrow", "hands")}
    return {**fields, "body": body, "decimals": decimals(outline)}


def _polygon(outline: Outline, shape: Shape) -> dict[str, Any]:
    digits = decimals(outline) + 2
    return {"role": shape.role, "corners": [[round(x, digits), round(y, digits)] for x, y in shape.corners]}


def _scenes(outline: Outline, scenes: Iterable[tuple[Shape, ...]]) -> list[dict[str, Any]]:
    """Fixed shapes of each scene, and a description of its obstacles, with their sizes if these differ."""
    layouts = [(shapes, obstacles_of(shapes)) for shapes in scenes]
    several_sizes = len({size for _, obstacles in layouts for _, size in obstacles}) > 1
    entries = []
    for shapes, obstacles in layouts:
        name = "no obstacle"
        if obstacles:
            sizes = [f"{width:g}" if width == height else f"{width:g} x {height:g}" for _, (width, height) in obstacles]
            distinct_sizes = sizes if len(set(sizes)) > 1 else sizes[:1]
            size = f" of {', '.join(distinct_sizes)} {outline.unit}" if several_sizes else ""
            count = f"{len(obstacles)} obstacle{'s' * (len(obstacles) > 1)}"
            name = f"{count}{size} at {positions_text(obstacles, outline)}"
        polygons = [_polygon(outline, shape) for shape in shapes]
        entries.append({"name": name, "obstacles": len(obstacles), "shapes": polygons})
    return entries


def _block(frames: EpisodeFrames, outline: Outline | None, interaction: Array | None) -> Array:
    """The columns `(T, n)` that the task offers, in the order of `FRAME_SCALES`."""
    columns = [] if interaction is None else [interaction[:, None]]
    if outline is not None:
        poses = outline.poses(frames.states)
        theta = (poses[:, 2:] + math.pi) % (2 * math.pi) - math.pi
        columns = [poses[:, :2], theta, outline.forces(frames.actions), *columns]
    return np.hstack(columns) if columns else np.empty((len(frames.states), 0))


def _quantised(block: Array, outline: Outline | None, measured: bool) -> tuple[dict[str, float], Array]:
    """Integers per unit of each existing column, and the columns `(T, n)` as such integers."""
    scales: dict[str, float] = {}
    if outline is not None:
        scales = dict(FRAME_SCALES)
        for name in ("x", "y"):
            scales[name] *= _SCENE / max(outline.size)
        scales.pop("interaction")
    if measured:
        largest = np.abs(block[:, -1]).max(initial=0.0)
        scales["interaction"] = min(FRAME_SCALES["interaction"], _LARGEST / max(float(largest), 1e-9))
    integers = np.clip(np.rint(block * list(scales.values())), -_LARGEST - 1, _LARGEST)
    return scales, integers.astype(np.int16)


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
