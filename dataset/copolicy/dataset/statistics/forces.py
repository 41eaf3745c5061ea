"""How hard the players press, and how much each does: interaction force, idle and saturated input."""

import numpy as np

from ..task_spec import PLAYERS
from .estimate import Estimate, Null
from .resampling import Bootstrap, circular_shift, interval
from .trajectories import Trajectories

PERCENTILES = (1, 5, 25, 50, 75, 95, 99)
MIN_EFFORT = 0.1
"""Force of a player below which it counts as none, in full forces."""

MIN_SPEED = 5.0
"""Speed of the table below which nobody is said to work with it or against it, px/s."""

_SHIFTS = 39
_MIN_SHIFT_S = 2.0
_BIN = 0.01
_FORCE = (
    "Interaction force: half the difference of both players' forces along the table, in units of a player's full "
    "force; positive pulls apart."
)


IDLE_BELOW = 0.1
SATURATED_ABOVE = 0.98


def force_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """Size of the interaction force, conflict, and asymmetry of effort."""
    episodes = len(data.rows)
    size = np.abs(data.force)
    frames = data.lengths.astype(float)
    mean, mean_bounds = bootstrap.ratio(data.per_episode(size), frames)
    signed = dict(zip(map(str, PERCENTILES), np.percentile(data.force, PERCENTILES).tolist(), strict=True))
    top, top_bounds = _percentile_95(data, size, bootstrap)
    effort = np.column_stack(
        [data.per_episode(np.linalg.norm(data.actions[:, side], axis=1)) for side in (slice(0, 2), slice(2, 4))]
    )
    asymmetry, asymmetry_bounds = bootstrap.ratio(effort[:, 0] - effort[:, 1], effort.sum(axis=1))
    return {
        "interaction_force_mean": Estimate(
            mean,
            "full forces",
            f"{_FORCE} Mean size; percentiles of the signed force in details.",
            episodes,
            mean_bounds,
            bootstrap.resampled,
            details={"signed_percentiles": signed},
        ),
        "interaction_force_p95": Estimate(
            top, "full forces", f"{_FORCE} 95th percentile of its size.", episodes, top_bounds, bootstrap.resampled
        ),
        "conflict_fraction": _conflict(data, bootstrap, rng),
        "effort_asymmetry": Estimate(
            asymmetry,
            "1",
            "(E0 - E1) / (E0 + E1) with E the mean size of a player's force: 1 where player 0 does all, 0 (the null) "
            "where both work alike.",
            episodes,
            asymmetry_bounds,
            bootstrap.resampled,
            note="" if asymmetry is not None else "no player applies a force",
        ),
    }


def opposed_work(velocity: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frames in which one player works with the table's motion and the other against it, and those that can tell.

    Args:
        velocity: `(N, 2)` of the table, px/s.
        actions: `(N, 4)` robot xy, human xy.

    Returns:
        `(N,)` opposed; `(N,)` the table moves and both players apply a force.
    """
    power = [actions[:, x] * velocity[:, 0] + actions[:, x + 1] * velocity[:, 1] for x in (0, 2)]
    efforts = [np.hypot(actions[:, x], actions[:, x + 1]) for x in (0, 2)]
    tells = (np.hypot(velocity[:, 0], velocity[:, 1]) > MIN_SPEED) & (np.minimum(*efforts) >= MIN_EFFORT)
    return tells & (power[0] * power[1] < 0), tells


def _conflict(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> Estimate:
    definition = (
        f"Share of frames in which one player's force works with the table's motion and the other's against it, of "
        f"those with the table faster than {MIN_SPEED:g} px/s and both forces at least {MIN_EFFORT:g}."
    )
    velocity = data.states[:, 4:6]
    opposed, tells = opposed_work(velocity, data.actions)
    value, bounds = bootstrap.ratio(data.per_episode(opposed), data.per_episode(tells))
    if value is None:
        return Estimate(None, "1", definition, 0, note="no frame in which both players push a moving table")
    draws = []
    for _ in range(_SHIFTS):
        order = circular_shift(data.starts, data.lengths, round(_MIN_SHIFT_S * data.fps), rng)
        turned = np.column_stack((data.actions[:, :2], data.actions[order, 2:]))
        apart, told = opposed_work(velocity, turned)
        draws.append(apart.sum() / max(told.sum(), 1))
    how = f"player 1 turned in time within each episode by at least {_MIN_SHIFT_S:g} s"
    null = Null.of(how, value, np.array(draws), two_sided=True)
    episodes = int((data.per_episode(tells) > 0).sum())
    return Estimate(value, "1", definition, episodes, bounds, bootstrap.resampled, null)


def _percentile_95(data: Trajectories, size: np.ndarray, bootstrap: Bootstrap) -> tuple[float, tuple[float, float]]:
    value = float(np.percentile(size, 95))
    bins = round(np.sqrt(2) / _BIN) + 1
    place = np.minimum((size / _BIN).astype(int), bins - 1)
    counts = np.bincount(data.episode * bins + place, minlength=len(data.rows) * bins).reshape(-1, bins)
    below = np.cumsum(bootstrap.weights @ counts.astype(np.float32), axis=1)
    drawn = (below < 0.95 * below[:, -1:]).sum(axis=1) * _BIN
    return value, interval(value, drawn, 0.0)


def activity_statistics(data: Trajectories, bootstrap: Bootstrap) -> dict[str, Estimate]:
    """Idle and saturated share of each player's frames."""
    estimates = {}
    frames = data.lengths.astype(float)
    for player, seat in enumerate(PLAYERS):
        action = data.actions[:, 2 * player : 2 * player + 2]
        idle = np.linalg.norm(action, axis=1) < IDLE_BELOW
        saturated = np.abs(action).max(axis=1) > SATURATED_ABOVE
        longest = longest_runs(idle, data.starts, data.lengths) / data.fps
        share, bounds = bootstrap.ratio(data.per_episode(idle), frames)
        estimates[f"idle_player_{player}"] = Estimate(
            share,
            "1",
            f"Share of frames in which player {player} ({seat} seat) applies less than {IDLE_BELOW:g} of a full force.",
            len(data.rows),
            bounds,
            bootstrap.resampled,
            details={"longest_s": float(longest.max()), "median_longest_of_an_episode_s": float(np.median(longest))},
        )
        share, bounds = bootstrap.ratio(data.per_episode(saturated), frames)
        estimates[f"saturation_player_{player}"] = Estimate(
            share,
            "1",
            f"Share of frames in which a component of player {player}'s force ({seat} seat) is over "
            f"{SATURATED_ABOVE:g} of the full force.",
            len(data.rows),
            bounds,
            bootstrap.resampled,
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
