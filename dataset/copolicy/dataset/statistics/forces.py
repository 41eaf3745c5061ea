"""How hard the players press, and how much each does: interaction force, idle and saturated input."""

import numpy as np

from .estimate import Estimate, Null, left_out
from .resampling import Bootstrap, circular_shift, interval
from .trajectories import Trajectories

PERCENTILES = (1, 5, 25, 50, 75, 95, 99)
MIN_EFFORT = 0.1
"""Force of a player below which it counts as none, in full forces."""

MIN_SPEED = 0.1
"""Speed below which nobody is said to work with a motion or against it, share of the highest of an axis."""

FULL_FORCES = "full forces"
"""Unit of an interaction measure in a player's full force."""

IDLE_BELOW = 0.1
SATURATED_ABOVE = 0.98
_SHIFTS = 39
_MIN_SHIFT_S = 2.0
_BIN = 0.01


def force_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """Size of the interaction measure, conflict, and asymmetry of effort."""
    episodes = len(data.rows)
    effort = [data.per_episode(np.linalg.norm(data.player_force(player), axis=1)) for player in (0, 1)]
    both = effort[0] + effort[1]
    definition = (
        "(E0 - E1) / (E0 + E1) with E the mean size of a player's force: 1 where player 0 does all, 0 (the null) where "
        "both work alike."
    )
    note = "" if both.any() else "no player applies a force"
    asymmetry = bootstrap.estimate(effort[0] - effort[1], both, "1", definition, episodes, note=note)
    return {**_interaction(data, bootstrap), **_conflict(data, bootstrap, rng), "effort_asymmetry": asymmetry}


def _interaction(data: Trajectories, bootstrap: Bootstrap) -> dict[str, Estimate]:
    names = ("interaction_force_mean", "interaction_force_p95")
    if not data.task.offers("interaction"):
        return left_out(data.task.missing("interaction measure"), *names)
    size, episodes, words = np.abs(data.interaction), len(data.rows), data.task.statistics
    signed = dict(zip(map(str, PERCENTILES), np.percentile(data.interaction, PERCENTILES).tolist(), strict=True))
    top, top_bounds = _percentile_95(data, size, bootstrap)
    mean_of = f"{words.interaction} Mean size; percentiles of the signed force in details."
    top_of, unit = f"{words.interaction} 95th percentile of its size.", words.interaction_unit
    sums, details = data.per_episode(size), {"signed_percentiles": signed}
    mean = bootstrap.estimate(sums, data.lengths.astype(float), unit, mean_of, episodes, details=details)
    return dict(zip(names, (mean, Estimate(top, unit, top_of, episodes, top_bounds, bootstrap.resampled)), strict=True))


def opposed_work(
    velocity: np.ndarray, forces: tuple[np.ndarray, np.ndarray], slow: float
) -> tuple[np.ndarray, np.ndarray]:
    """Frames in which one player works with the motion and the other against it, and those that can tell.

    Args:
        velocity: `(N, k)`.
        forces: `(N, k)` of each player, along the same axes.
        slow: speed up to which nothing moves.

    Returns:
        `(N,)` opposed; `(N,)` it moves and both players apply a force.
    """
    power = [(force * velocity).sum(axis=1) for force in forces]
    efforts = [np.hypot.reduce(force, axis=1) for force in forces]
    tells = (np.hypot.reduce(velocity, axis=1) > slow) & (np.minimum(*efforts) >= MIN_EFFORT)
    return tells & (power[0] * power[1] < 0), tells


def _conflict(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    task, name = data.task, "conflict_fraction"
    noun, places, state = task.words.noun, task.statistics.velocity, task.spec.state
    if len(places) != len(data.task.spec.action):
        return left_out(data.task.missing("velocity along the axes of an action"), name)
    slow = MIN_SPEED * state.high[places[0]]
    definition = (
        f"Share of frames in which one player's force works with the {noun}'s motion and the other's against it, of "
        f"those with the {noun} faster than {slow:g} {state.units[places[0]]} and both forces at least {MIN_EFFORT:g}."
    )
    velocity, one, other = data.velocity, data.player_force(0), data.player_force(1)
    opposed, tells = opposed_work(velocity, (one, other), slow)
    value, bounds = bootstrap.ratio(data.per_episode(opposed), data.per_episode(tells))
    if value is None:
        return {name: Estimate(None, "1", definition, 0, note=f"no frame in which both players push a moving {noun}")}
    draws = []
    for _ in range(_SHIFTS):
        order = circular_shift(data.starts, data.lengths, round(_MIN_SHIFT_S * data.fps), rng)
        apart, told = opposed_work(velocity, (one, other[order]), slow)
        draws.append(apart.sum() / max(told.sum(), 1))
    how = f"player 1 turned in time within each episode by at least {_MIN_SHIFT_S:g} s"
    null = Null.from_draws(how, value, np.array(draws), two_sided=True)
    episodes = int((data.per_episode(tells) > 0).sum())
    return {name: Estimate(value, "1", definition, episodes, bounds, bootstrap.resampled, null)}


def _percentile_95(data: Trajectories, size: np.ndarray, bootstrap: Bootstrap) -> tuple[float, tuple[float, float]]:
    value = float(np.percentile(size, 95))
    # Up to two full forces at a right angle, or in as many bins to the largest.
    bins = round(np.sqrt(2) / _BIN) + 1
    width = _BIN if data.task.statistics.interaction_unit == FULL_FORCES else float(size.max()) / bins or 1.0
    place = np.minimum((size / width).astype(int), bins - 1)
    counts = np.bincount(data.episode * bins + place, minlength=len(data.rows) * bins).reshape(-1, bins)
    below = np.cumsum(bootstrap.weights @ counts.astype(np.float32), axis=1)
    drawn = (below < 0.95 * below[:, -1:]).sum(axis=1) * width
    return value, interval(value, drawn, 0.0)


def activity_statistics(data: Trajectories, bootstrap: Bootstrap) -> dict[str, Estimate]:
    """Idle and saturated share of each player's frames."""
    estimates = {}
    frames, episodes = data.lengths.astype(float), len(data.rows)
    for player, seat in enumerate(data.task.spec.players):
        action = data.player_force(player)
        idle = np.linalg.norm(action, axis=1) < IDLE_BELOW
        saturated = np.abs(action).max(axis=1) > SATURATED_ABOVE
        longest = longest_runs(idle, data.starts, data.lengths) / data.fps
        definitions = (
            f"Share of frames in which player {player} ({seat} seat) applies less than {IDLE_BELOW:g} of a full force.",
            f"Share of frames in which a component of player {player}'s force ({seat} seat) is over "
            f"{SATURATED_ABOVE:g} of the full force.",
        )
        runs = {"longest_s": float(longest.max()), "median_longest_of_an_episode_s": float(np.median(longest))}
        estimates[f"idle_player_{player}"] = bootstrap.estimate(
            data.per_episode(idle), frames, "1", definitions[0], episodes, details=runs
        )
        estimates[f"saturation_player_{player}"] = bootstrap.estimate(
            data.per_episode(saturated), frames, "1", definitions[1], episodes
        )
    return estimates


def longest_runs(flags: np.ndarray, starts: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """`(E,)` longest run of true frames in each episode."""
    longest = np.zeros(len(starts), dtype=int)
    for index, (start, length) in enumerate(zip(starts.tolist(), lengths.tolist(), strict=True)):
        edges = np.flatnonzero(np.diff(flags[start : start + length].astype(np.int8), prepend=0, append=0))
        if len(edges):
            longest[index] = (edges[1::2] - edges[::2]).max()
    return longest
