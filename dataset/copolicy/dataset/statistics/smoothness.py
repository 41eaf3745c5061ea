"""Bandwidth of the input and smoothness of the motion: f95, SPARC and log dimensionless jerk."""

import numpy as np
from scipy.signal import welch

from ..arrays import Array
from .estimate import Estimate, left_out
from .resampling import Bootstrap
from .trajectories import Trajectories

WELCH_S = 3.2
"""Length of a Welch segment, s; its inverse is the frequency resolution, Hz."""

MIN_S = 1.0
"""Shortest episode, s, for which spectrum and smoothness are computed."""

_POWER_FRACTION = 0.95
_SPARC_CUTOFF_HZ = 10.0
_SPARC_THRESHOLD = 0.05
_SPARC_PADDING = 4


def f95(action: Array, fps: float) -> float:
    """Frequency below which 95 percent of the power of an action `(T, m)` lies, Hz; NaN for a constant action.

    Welch's power spectral density (Hann window, mean removed, half overlap), summed over axes, interpolated.
    """
    segment = min(len(action), max(4, round(WELCH_S * fps)))
    frequency, power = welch(action, fs=fps, nperseg=segment, axis=0, detrend="constant")
    cumulative = np.cumsum(power.sum(axis=1))
    if not cumulative[-1] > 1e-12:
        return float("nan")
    # The power of a bin is spread over half a bin on both sides of its frequency.
    edges = np.minimum(frequency + (frequency[1] - frequency[0]) / 2, fps / 2)
    return float(np.interp(_POWER_FRACTION * cumulative[-1], cumulative, edges))


def sparc(speed: Array, fps: float) -> float:
    """Spectral arc length of a speed profile `(T,)`: 0 is smoothest; NaN without motion.

    Length of the normalised magnitude spectrum up to 10 Hz (or half the rate), between the first and last value of at
    least 0.05 (Balasubramanian, Melendez-Calderon, Roby-Brami and Burdet 2015).
    """
    points = 2 ** (int(np.ceil(np.log2(len(speed)))) + _SPARC_PADDING)
    magnitude = np.abs(np.fft.rfft(speed, points))
    if not magnitude.max() > 1e-9:
        return float("nan")
    frequency = np.fft.rfftfreq(points, 1 / fps)
    magnitude = magnitude / magnitude.max()
    inside = frequency <= min(_SPARC_CUTOFF_HZ, fps / 2)
    above = np.flatnonzero(inside & (magnitude >= _SPARC_THRESHOLD))
    chosen = slice(above[0], above[-1] + 1)
    frequency, magnitude = frequency[chosen], magnitude[chosen]
    if len(frequency) < 2:
        return float("nan")
    steps = np.diff(frequency) / (frequency[-1] - frequency[0])
    return -float(np.hypot(steps, np.diff(magnitude)).sum())


def log_dimensionless_jerk(speed: Array, fps: float) -> float:
    """-ln(T^3 / v_peak^2 * integral of (d2v/dt2)^2) of a speed profile `(T,)`; larger is smoother; NaN without motion.

    Source: see `sparc`. A minimum-jerk movement has -ln(204.8) = -5.32.
    """
    peak = float(np.abs(speed).max())
    jerk = np.diff(speed, 2) * fps**2
    duration = (len(speed) - 1) / fps
    integral = float((jerk**2).sum()) / fps
    if not peak > 1e-9 or not integral > 0:
        return float("nan")
    return -float(np.log(duration**3 / peak**2 * integral))


def smoothness_statistics(data: Trajectories, bootstrap: Bootstrap) -> dict[str, Estimate]:
    """Means over episodes of each player's f95, and of the smoothness of the body's speed."""
    names = ("action_f95_player_0", "action_f95_player_1", "sparc", "log_dimensionless_jerk")
    values = np.full((len(data.rows), len(names)), np.nan)
    actions, speed = [data.player_force(player) for player in (0, 1)], np.linalg.norm(data.velocity, axis=1)
    for index, (start, end) in enumerate(zip(data.starts.tolist(), data.ends.tolist(), strict=True)):
        if end - start < MIN_S * data.fps or end - start < 4:
            continue
        speed_smoothness = (sparc(speed[start:end], data.fps), log_dimensionless_jerk(speed[start:end], data.fps))
        values[index] = (*(f95(action[start:end], data.fps) for action in actions), *speed_smoothness)
    spectrum = (
        "Frequency below which 95 % of the power of player {}'s action lies (Welch, segments of "
        f"{WELCH_S:g} s{data.axes}), mean over episodes; at most half the frame rate of {data.fps} Hz."
    )
    speed_of = f"of the {data.task.words.noun}'s speed"
    rate = f"{speed_of}, mean over episodes. Comparable only at the same frame rate ({data.fps} Hz)."
    definitions = (
        ("Hz", spectrum.format(0)),
        ("Hz", spectrum.format(1)),
        ("1", f"Spectral arc length {rate} 0 is smoothest."),
        ("1", f"Log dimensionless jerk {rate} Larger is smoother; -5.32 is a minimum-jerk movement."),
    )
    estimates = {}
    for column, (name, (unit, definition)) in enumerate(zip(names, definitions, strict=True)):
        value, bounds = bootstrap.mean(values[:, column])
        note = "" if value is not None else f"no episode of {MIN_S:g} s in which it moves"
        episodes = int(np.isfinite(values[:, column]).sum())
        estimates[name] = Estimate(value, unit, definition, episodes, bounds, bootstrap.resampled, note=note)
    task = data.task
    return estimates if task.statistics.velocity else estimates | left_out(task.missing("velocity"), *names[2:])
