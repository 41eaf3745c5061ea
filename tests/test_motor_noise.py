"""Motor noise: rate and length of pauses and slips, additive noise, drift of the effort, pulses."""

import math
from dataclasses import replace

import numpy as np
import pytest

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task_spec import RECORD_HZ
from copolicy.tasks.table.agents import NEVER_YIELDS, PlayerProfile
from copolicy.tasks.table.agents.motor_noise import MotorNoise

MINUTE = 60 * RECORD_HZ


def make_noise(seed: int = 0, **values: float) -> MotorNoise:
    """Noiseless but for these values of the profile."""
    return MotorNoise(replace(NEVER_YIELDS, **values), np.random.default_rng(seed))


def applied(noise: MotorNoise, steps: int, intended: tuple[float, float] = (0.5, 0.0)) -> np.ndarray:
    return np.array([noise.apply(*intended) for _ in range(steps)])


def stretches(flags: np.ndarray) -> np.ndarray:
    """Lengths of the runs of True that both begin and end within."""
    edges = np.flatnonzero(np.diff(flags.astype(int)))
    edges = edges[1:] if flags[0] else edges
    return np.diff(edges)[::2]


def test_without_noise_the_intended_force_is_applied():
    motor = make_noise()
    rng = np.random.default_rng(1)
    for x, y in rng.uniform(-1, 1, (500, 2)):
        assert motor.apply(x, y) == (x, y)
    assert motor.apply(3.0, -1.5) == (1.0, -1.0)  # a full force is all there is
    assert (motor.pauses, motor.slips) == (0, 0)


def test_equal_seeds_give_equal_noise():
    profile = PlayerProfile()
    first, same, other = (MotorNoise(profile, np.random.default_rng(seed)) for seed in (3, 3, 4))
    np.testing.assert_array_equal(applied(first, 300), applied(same, 300))
    assert not np.array_equal(applied(first, 300), applied(other, 300))


def test_rate_and_length_of_pauses():
    motor = make_noise(pauses_per_min=6.0)
    force = applied(motor, 60 * MINUTE)
    # No pause begins during a pause, and pauses take a twelfth of the time.
    active_min = 60 * (1 - 6.0 * 0.8 / 60)
    assert motor.pauses == pytest.approx(6.0 * active_min, abs=3 * math.sqrt(6.0 * active_min))
    weak = stretches(force[:, 0] < 0.25)
    # The force falls by half within three steps and comes back as fast: it is below half for as long as the pause.
    assert weak.min() >= 0.4 * RECORD_HZ - 2
    assert np.mean(weak) == pytest.approx(0.8 * RECORD_HZ, rel=0.06)
    assert force[:, 0].min() < 0.01
    assert np.quantile(force[:, 0], 0.5) == pytest.approx(0.5, abs=1e-3)
    assert not force[:, 1].any()


def test_rate_size_and_length_of_slips():
    motor = make_noise(seed=1, slips_per_min=6.0)
    force = applied(motor, 60 * MINUTE, intended=(0.0, 0.0))
    assert motor.slips == pytest.approx(6 * 60 * (1 - 6.0 * 0.35 / 60), abs=3 * math.sqrt(6 * 60))
    slipping = np.any(force != 0.0, axis=1)
    lengths = stretches(slipping)
    # A slip may follow the one before at once.
    assert np.median(lengths) == pytest.approx(0.35 * RECORD_HZ, abs=1.5)
    assert lengths.min() >= 0.2 * RECORD_HZ
    sizes = np.hypot(*force[slipping].T)
    assert sizes.min() >= 0.4 - 1e-12
    assert sizes.max() <= 0.9 + 1e-12
    assert np.mean(sizes) == pytest.approx(0.65, abs=0.03)
    assert np.hypot(*force[slipping].mean(axis=0)) < 0.08  # in every direction
    begins = np.flatnonzero(np.diff(slipping.astype(int)) == 1) + 1
    assert len(np.unique(force[begins], axis=0)) == len(begins)  # each one anew
    np.testing.assert_array_equal(force[begins], force[begins + 3])  # and steady while it lasts


def test_effort_drifts_over_seconds():
    drift = np.log(applied(make_noise(seed=2, effort_drift=0.2), 120 * MINUTE, intended=(0.25, 0.0))[:, 0] / 0.25)
    assert np.mean(drift) == pytest.approx(0.0, abs=0.03)
    assert np.std(drift) == pytest.approx(0.2, rel=0.05)
    for seconds in (1.0, 3.0, 6.0):  # correlation time 3 s
        lag = round(seconds * RECORD_HZ)
        correlation = np.corrcoef(drift[:-lag], drift[lag:])[0, 1]
        assert correlation == pytest.approx(math.exp(-seconds / 3.0), abs=0.08)


def test_noise_is_slow_and_the_same_in_both_axes():
    noise = applied(make_noise(seed=3, noise=0.1), 60 * MINUTE, intended=(0.0, 0.0))
    np.testing.assert_allclose(noise.std(axis=0), 0.1, rtol=0.05)
    lag = RECORD_HZ // 2
    for axis in (0, 1):
        correlation = np.corrcoef(noise[:-lag, axis], noise[lag:, axis])[0, 1]
        assert correlation == pytest.approx(math.exp(-1), abs=0.06)
    assert abs(np.corrcoef(noise.T)[0, 1]) < 0.06


def test_pulses_weaken_by_up_to_the_impulsiveness():
    force = applied(make_noise(seed=4, impulsiveness=0.4), 30 * MINUTE)[RECORD_HZ:, 0]
    assert 0.5 * 0.6 <= force.min() < 0.5 * 0.65
    assert 0.5 * 0.95 < force.max() <= 0.5
    assert np.mean(force) == pytest.approx(0.5 * 0.8, rel=0.02)


def test_force_stays_within_a_full_one_for_any_profile():
    motor = make_noise(seed=5, noise=0.6, effort_drift=1.0, slips_per_min=60.0, pauses_per_min=20.0)
    force = applied(motor, 5 * MINUTE, intended=(0.9, -0.9))
    assert np.abs(force).max() == 1.0
    assert np.all(np.isfinite(force))


@pytest.mark.parametrize("name", ["effort_drift", "pauses_per_min", "slips_per_min", "noise", "patience_s", "effort"])
@pytest.mark.parametrize("value", [-0.5, math.nan, math.inf])
def test_values_out_of_range_are_refused(name, value):
    text = f"^PlayerProfile.{name}: expected a finite number, not negative, found {value}$"
    with pytest.raises(InvalidValueError, match=text):
        PlayerProfile(**{name: value})


@pytest.mark.parametrize("name", ["speed", "route_temperature", "clearance"])
def test_values_that_must_be_positive(name):
    with pytest.raises(InvalidValueError, match=rf"^PlayerProfile.{name}: expected a positive number, found 0.0$"):
        replace(PlayerProfile(), **{name: 0.0})


def test_a_bias_to_the_right_is_negative_and_a_delay_is_whole():
    assert PlayerProfile(left_bias=-20.0).left_bias == -20.0
    with pytest.raises(InvalidValueError, match=r"^PlayerProfile.delay_steps: expected a whole number, found 2.5$"):
        PlayerProfile(delay_steps=2.5)  # pyright: ignore[reportArgumentType]
