"""Counts of behaviours, with intervals over maps and null distributions."""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.scenarios import base_name
from copolicy.dataset.statistics.estimate import Estimate, Null
from copolicy.dataset.statistics.resampling import MIN_CLUSTERS, Bootstrap, circular_shift

from ..comparison.paired import REPLICATES
from .definitions import MIN_SHIFT_S, NULLS, Behaviour
from .motion import Event, Motion

DRAWS = 39
"""Draws of a null distribution; the smallest p is 1 / 40."""

INTERVALS = f"intervals are over maps, of fewer than {MIN_CLUSTERS} maps over episodes, which is too narrow"
"""What the bootstrap resamples."""


def count(behaviour: Behaviour, motion: Motion, seed: int) -> tuple[dict[str, Any], list[Event]]:
    """Rate and proportion of episodes of a behaviour, and its instances, the clearest one first.

    Returns:
        `per_minute` with its null distribution, `episodes` (proportion with at least one), and the counts of each entry
        of the details of its instances.
    """
    rng = np.random.default_rng(seed)
    events = behaviour.find(motion, None)
    maps = np.unique([base_name(row.map_id) for row in motion.frames.rows], return_inverse=True)[1]
    bootstrap = Bootstrap(maps, REPLICATES, rng)
    bootstrap.resampled = "maps" if bootstrap.resampled == "pairs" else bootstrap.resampled
    number, minutes = _per_episode(events, motion), motion.minutes
    episodes = len(number)
    rate = _bounded(bootstrap.estimate(number, minutes, "1/min", behaviour.definition, episodes), math.inf)
    draws = [
        len(behaviour.find(motion, order)) / minutes.sum()
        for order in _orders(behaviour, motion, rng)
        if rate.value is not None
    ]
    if draws:
        null = Null.from_draws(NULLS[behaviour.null], rate.value or 0.0, np.array(draws), two_sided=True)
        rate = replace(rate, null=null)
    else:
        rate = replace(rate, note="no null distribution: all episodes have the same obstacles")
    proportion = bootstrap.estimate(
        (number > 0).astype(float), np.ones(episodes), "1", "Proportion of episodes with at least one.", episodes
    )
    entries = sorted({name for event in events for name in event.details})
    found = {name: dict(Counter(event.details[name] for event in events).most_common()) for name in entries}
    described: dict[str, Any] = {
        "number": len(events),
        "per_minute": rate.as_dict(),
        "episodes": _bounded(proportion, 1.0).as_dict(),
        **({"details": found} if found else {}),
    }
    return described, sorted(events, key=lambda event: -event.score)


def _bounded(estimate: Estimate, high: float) -> Estimate:
    """An estimate whose interval ends at 0 and `high`, which the shift of the bootstrap can pass."""
    if estimate.interval is None:
        return estimate
    low, upper = estimate.interval
    return replace(estimate, interval=(max(0.0, low), min(high, upper)))


def _per_episode(events: list[Event], motion: Motion) -> Array:
    return np.bincount([event.episode for event in events], minlength=len(motion.frames.rows)).astype(float)


def _orders(behaviour: Behaviour, motion: Motion, rng: np.random.Generator) -> list[Array]:
    """The reordered indices of each draw of the null distribution; empty if there is nothing to reorder."""
    data = motion.frames
    if behaviour.null == "shift":
        shortest = round(MIN_SHIFT_S * data.fps)
        return [circular_shift(data.starts, data.lengths, shortest, rng) for _ in range(DRAWS)]
    layouts = [motion.task.layout(row.scenario) for row in data.rows]
    others = {
        layout: np.array([index for index, other in enumerate(layouts) if other != layout]) for layout in set(layouts)
    }
    if not all(len(indices) for indices in others.values()):
        return []
    return [np.array([rng.choice(others[layout]) for layout in layouts]) for _ in range(DRAWS)]


def rate_text(entry: Mapping[str, Any]) -> str:
    """A rate, as `count` returns it, with its interval and null mean, for tables."""
    if entry["value"] is None:
        return "none"
    low, high = entry["interval"]
    null = entry.get("null")
    text = f"{entry['value']:.2f} ({low:.2f} to {high:.2f})"
    return text if null is None else f"{text}, null {null['mean']:.2f}, p {null['p']:.3f}"
