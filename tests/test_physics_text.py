"""The settings of the dynamics as a text, there and back."""

import json
import math
from dataclasses import asdict

import pytest

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.physics_text import physics_counts, physics_of, physics_summary, physics_text
from copolicy.tasks.table.physics import Physics

EIGHTH = Physics(angular_acceleration_limit=math.pi / 8)


def test_the_text_is_canonical_and_exact():
    physics = Physics(angular_acceleration_limit=0.1 + 0.2, step_limit=77, mass=3.0)
    text = physics_text(physics)
    assert json.loads(text) == asdict(physics)
    assert list(json.loads(text)) == sorted(asdict(physics))
    assert physics_of(text) == physics
    assert physics_of(json.dumps(asdict(physics), indent=3)) == physics


@pytest.mark.parametrize("text", ["", None])
def test_nothing_stated_is_unknown(text):
    assert physics_of(text) is None


@pytest.mark.parametrize(
    "entries",
    [
        {"mass": "2.0"}, {"mass": True}, {"mass": 0.0}, {"inertia": -1.0}, {"linear_damping": math.nan},
        {"force_scale": math.inf}, {"step_limit": 0}, {"step_limit": 10.5}, {"angular_acceleration_limit": 0},
        {"gravity": 9.81}, {"lever": None}, {"lever": 10**400},
    ],
)  # fmt: skip
def test_a_text_of_other_settings_is_refused(entries):
    with pytest.raises(InvalidValueError, match="found"):
        physics_of(json.dumps({**asdict(Physics()), **entries}))


@pytest.mark.parametrize("text", ["pi/8", "{}", "[1]", "0.39", '{"mass": 2.0}', "[" * 100_000])
def test_another_text_is_refused(text):
    with pytest.raises(InvalidValueError, match="physics: expected an empty text, or JSON of the settings"):
        physics_of(text)


def test_episodes_are_counted_by_what_their_settings_say():
    texts = [physics_text(EIGHTH), physics_text(Physics()), "", None, json.dumps(asdict(EIGHTH)), physics_text(EIGHTH)]
    assert physics_counts(texts) == {
        "angular acceleration up to pi/8 rad/s^2": 3,
        "unknown": 2,
        "angular acceleration up to pi/2 rad/s^2": 1,
    }
    other = Physics(angular_acceleration_limit=1.0, step_limit=2000, mass=3.0)
    assert physics_summary(other) == "angular acceleration up to 1.0 rad/s^2, step_limit 2000, mass 3"
