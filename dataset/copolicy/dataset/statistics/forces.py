"""Statistics of forces: interaction measure, conflict, asymmetry of effort, idle and saturated input."""

import numpy as np

from ..arrays import Array
from .estimate import Estimate, Null, left_out
from .resampling import Bootstrap, circular_shift, interval
from .trajectories import Trajectories

PERCENTILES = (1, 5, 25, 50, 75, 95, 99)
MIN_EFFORT = 0.1
"""Force below which a player counts as passive, in full forces."""

MIN_SPEED = 0.1
"""Speed below which the sign of a player's power is ignored, as a fraction of the highest speed of an axis."""

FULL_FORCES = "full forces"
"""Unit of an interaction measure in units of a player's full force."""

IDLE_BELOW = 0.1
SATURATED_ABOVE = 0.98
_SHIFTS = 39
_MIN_SHIFT_S = 2.0
_BIN = 0.01


def force_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """Size of the interaction measure, conflict, and asymmetry of effort."""
    episodes = len(data.rows)
    effort = [data.per_episode(np.linalg.norm(data.player_force(player), axis=1)) for player in (0, 1)]
    total_effort = effort[0] + effort[1]
    definition = (
        "(E0 - E1) / (E0 + E1) with E the mean magnitude of a player's force: 1 if player 0 applies all force, 0 (the "
        "null) if both apply the same."
    )
    note = "" if total_effort.any() else "no player applies a force"
    asymmetry = bootstrap.estimate(effort[0] - effort[1], total_effort, "1", definition, episodes, note=note)
    return {**_interaction(data, bootstrap), **_conflict(data, bootstrap, rng), "effort_asymmetry": asymmetry}


def _interaction(data: Trajectories, bootstrap: Bootstrap) -> dict[str, Estimate]:
    names = ("interaction_force_mean", "interaction_force_p95")
    if not data.task.offers("interaction"):
        return left_out(data.task.missing("interaction measure"), *names)
    size, episodes, measure = np.abs(data.interaction), len(data.rows), data.task.statistics
    signed = dict(zip(map(str, PERCENTILES), np.percentile(data.interaction, PERCENTILES).tolist(), strict=True))
    p95, p95_bounds = _percentile_95(data, size, bootstrap)
    mean_definition = f"{measure.interaction} Mean size; percentiles of the signed force in details."
    p95_definition, unit = f"{measure.interaction} 95th percentile of its size.", measure.interaction_unit
    sums, details = data.per_episode(size), {"signed_percentiles": signed}
    mean = bootstrap.estimate(sums, data.lengths.astype(float), unit, mean_definition, episodes, details=details)
    return {names[0]: mean, names[1]: Estimate(p95, unit, p95_definition, episodes, p95_bounds, bootstrap.resampled)}


def opposed_work(velocity: Array, forces: tuple[Array, Array], min_speed: float) -> tuple[Array, Array]:
    """Frames in which one player's force has positive power and the other's negative power.

    Args:
        velocity: `(N, k)`.
        forces: `(N, k)` for each player, along the same axes.
        min_speed: speed up to which the body counts as at rest.

    Returns:
        `(N,)` opposed power; `(N,)` counted frames, in which the body moves and both players apply a force.
    """
    power = [(force * velocity).sum(axis=1) for force in forces]
    efforts = [np.hypot.reduce(force, axis=1) for force in forces]
    counted = (np.hypot.reduce(velocity, axis=1) > min_speed) & (np.minimum(*efforts) >= MIN_EFFORT)
    return counted & (power[0] * power[1] < 0), counted


def _conflict(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    task, name = data.task, "conflict_fraction"
    noun, velocity_indices, state = task.words.noun, task.statistics.velocity, task.spec.state
    if len(velocity_indices) != len(data.task.spec.action):
        return left_out(data.task.missing("velocity along the axes of an action"), name)
    min_speed = MIN_SPEED * state.high[velocity_indices[0]]
    definition = (
        f"Proportion of frames in which one player's force acts along the {noun}'s velocity and the other's against "
        f"it, of those with the {noun} faster than {min_speed:g} {state.units[velocity_indices[0]]} and both forces at "
        f"least {MIN_EFFORT:g}."
    )
    velocity, first, second = data.velocity, data.player_force(0), data.player_force(1)
    opposed, counted = opposed_work(velocity, (first, second), min_speed)
    value, bounds = bootstrap.ratio(data.per_episode(opposed), data.per_episode(counted))
    if value is None:
        return {name: Estimate(None, "1", definition, 0, note=f"no frame in which both players push a moving {noun}")}
    draws = []
    for _ in range(_SHIFTS):
        order = circular_shift(data.starts, data.lengths, round(_MIN_SHIFT_S * data.fps), rng)
        shifted_opposed, shifted_counted = opposed_work(velocity, (first, second[order]), min_speed)
        draws.append(shifted_opposed.sum() / max(shifted_counted.sum(), 1))
    method = f"player 1's actions circularly shifted in time within each episode by at least {_MIN_SHIFT_S:g} s"
    null = Null.from_draws(method, value, np.array(draws), two_sided=True)
    episodes = int((data.per_episode(counted) > 0).sum())
    return {name: Estimate(value, "1", definition, episodes, bounds, bootstrap.resampled, null)}


def _percentile_95(data: Trajectories, size: Array, bootstrap: Bootstrap) -> tuple[float, tuple[float, float]]:
    value = float(np.percentile(size, 95))
    # Bins of _BIN up to sqrt(2) full forces, or as many bins up to the maximum.
    bins = round(np.sqrt(2) / _BIN) + 1
    width = _BIN if data.task.statistics.interaction_unit == FULL_FORCES else float(size.max()) / bins or 1.0
    bin_index = np.minimum((size / width).astype(int), bins - 1)
    counts = np.bincount(data.episode * bins + bin_index, minlength=len(data.rows) * bins).reshape(-1, bins)
    cumulative = np.cumsum(bootstrap.weights @ counts.astype(np.float32), axis=1)
    replicates = (cumulative < 0.95 * cumulative[:, -1:]).sum(axis=1) * width
    return value, interval(value, replicates, 0.0)


def activity_statistics(data: Trajectories, bootstrap: Bootstrap) -> dict[str, Estimate]:
    """Proportions of idle and saturated frames for each player."""
    estimates = {}
    frames, episodes = data.lengths.astype(float), len(data.rows)
    for player, seat in enumerate(data.task.spec.players):
        action = data.player_force(player)
        idle = np.linalg.norm(action, axis=1) < IDLE_BELOW
        saturated = np.abs(action).max(axis=1) > SATURATED_ABOVE
        longest = longest_runs(idle, data.starts, data.lengths) / data.fps
        definitions = (
            f"Proportion of frames in which player {player} ({seat} seat) applies less than {IDLE_BELOW:g} full force.",
            f"Proportion of frames in which a component of player {player}'s force ({seat} seat) is above "
            f"{SATURATED_ABOVE:g} full force.",
        )
        runs = {"longest_s": float(longest.max()), "median_longest_of_an_episode_s": float(np.median(longest))}
        estimates[f"idle_player_{player}"] = bootstrap.estimate(
            data.per_episode(idle), frames, "1", definitions[0], episodes, details=runs
        )
        estimates[f"saturation_player_{player}"] = bootstrap.estimate(
            data.per_episode(saturated), frames, "1", definitions[1], episodes
        )
    return estimates


def longest_runs(flags: Array, starts: Array, lengths: Array) -> Array:
    """`(E,)` length of the longest run of true flags `(N,)` in each episode, frames."""
    longest = np.zeros(len(starts), dtype=int)
    for index, (start, length) in enumerate(zip(starts.tolist(), lengths.tolist(), strict=True)):
        edges = np.flatnonzero(np.diff(flags[start : start + length].astype(np.int8), prepend=0, append=0))
        if len(edges):
            longest[index] = (edges[1::2] - edges[::2]).max()
    return longest
