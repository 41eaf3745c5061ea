"""The data inside the page: episodes as JSON, their frames as 16-bit integers in base64."""

import base64
import math
from importlib.metadata import version
from typing import Any

import numpy as np

from copolicy.dataset.episode import EPISODE_COLUMNS
from copolicy.dataset.task_spec import RECORD_HZ
from copolicy.tasks.table.map_config import WINDOW
from copolicy.tasks.table.physics import GOAL_SIZE

from ..artefacts import KeptFindings, estimates, statistics_doubt
from ..facts import DatasetFacts
from ..frames import EpisodeFrames, read_frames
from ..routes import route_statistics

FRAME_SCALES = {
    "x": 20, "y": 20, "theta": 10_000,
    "robot_fx": 32_000, "robot_fy": 32_000, "human_fx": 32_000, "human_fy": 32_000, "interaction": 20_000,
}  # fmt: skip
"""Integers in one unit of each column: a step is 0.05 px, 0.1 mrad, 1/32,000 of a full force."""

FRAME_BYTES = 6_000_000
"""Frames take at most this much of the page; a larger data set shows every second, third, ... frame."""

_COLUMNS = (*(name for name in EPISODE_COLUMNS if name != "physics"), "episode_index", "length")


def build_payload(
    facts: DatasetFacts,
    title: str,
    findings: KeptFindings | None = None,
    statistics: dict[str, Any] | None = None,
    frame_bytes: int = FRAME_BYTES,
) -> dict[str, Any]:
    """Everything that the page shows, JSON-able: numbers that are not finite become null.

    Args:
        findings: what `copolicy-dataset check` kept, None where it was not run.
        statistics: what `copolicy-dataset stats` stored, None where it was not run.

    Raises:
        FileFormatError: the frames cannot be read.
    """
    step = max(1, math.ceil(facts.info["total_frames"] * 2 * len(FRAME_SCALES) / frame_bytes))
    blocks: list[np.ndarray] = []
    rows: list[dict[str, Any]] = []
    start = 0
    for episode, frames in zip(facts.episodes, read_frames(facts), strict=True):
        block = _quantised(frames)[::step]
        size = np.abs(frames.interaction)
        config = frames.map_config
        rows.append(
            {name: _finite(episode[name]) for name in _COLUMNS}
            | {
                "map": {
                    "start": config.start,
                    "goal": config.goal,
                    "obstacles": [centre for centre, _ in config.layout],
                    "sizes": [size for _, size in config.layout],
                },
                "from": start,
                "frames": len(block),
                "force_mean": float(size.mean()),
                "force_p95": float(np.quantile(size, 0.95)),
            }
        )
        blocks.append(block)
        start += len(block)
    routes = None if statistics is None else route_statistics(statistics)
    return {
        "title": title,
        "software": f"copolicy {version('lerobot_policy_copolicy')}",
        "format": facts.info["codebase_version"],
        "fps": facts.info["fps"],
        "record_hz": RECORD_HZ,
        "frame_step": step,
        "window": WINDOW,
        "goal_size": GOAL_SIZE,
        "scales": FRAME_SCALES,
        "episodes": rows,
        "frames": base64.b64encode(np.concatenate(blocks).astype("<i2").tobytes()).decode(),
        "check": None if findings is None else _check(findings),
        "statistics": None if statistics is None else estimates(statistics),
        "statistics_doubt": statistics_doubt(statistics or {}, len(facts.episodes)),
        "routes": None if routes is None else routes.to_json(),
    }


def _check(findings: KeptFindings) -> dict[str, Any]:
    """What the page shows of the findings; the limits and the names of all rules stay in the file."""
    kept = {name: findings.document.get(name) for name in ("date", "rules_version", "rules", "findings")}
    return {**kept, "state": findings.validity.state, "reason": findings.validity.reason}


def _quantised(frames: EpisodeFrames) -> np.ndarray:
    """`(T, 8)` integers, columns in the order of `FRAME_SCALES`."""
    theta = (frames.theta + math.pi) % (2 * math.pi) - math.pi
    table = np.column_stack((frames.states[:, :2], theta, frames.actions, frames.interaction))
    return np.clip(np.rint(table * list(FRAME_SCALES.values())), -32_768, 32_767).astype(np.int16)


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
