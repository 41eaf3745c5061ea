"""The settings of the dynamics as a text, there and back."""

import json
import math
from dataclasses import asdict

import pytest

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.settings_text import count_settings, describe_settings, parse_settings_text, settings_text
from copolicy.tasks.table.physics import Physics

EIGHTH = Physics(angular_acceleration_limit=math.pi / 8)


def test_the_text_is_canonical_and_exact():
    physics = Physics(angular_acceleration_limit=0.1 + 0.2, step_limit=77, mass=3.0)
    text = settings_text(physics)
    assert json.loads(text) == asdict(physics)
    assert list(json.loads(text)) == sorted(asdict(physics))
    assert parse_settings_text(text) == physics
    assert parse_settings_text(json.dumps(asdict(physics), indent=3)) == physics


@pytest.mark.parametrize("text", ["", None])
def test_nothing_stated_is_unknown(text):
    assert parse_settings_text(text) is None


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
        parse_settings_text(json.dumps({**asdict(Physics()), **entries}))


@pytest.mark.parametrize("text", ["pi/8", "{}", "[1]", "0.39", '{"mass": 2.0}', "[" * 100_000])
def test_another_text_is_refused(text):
    with pytest.raises(InvalidValueError, match="physics: expected an empty text, or JSON of the settings"):
        parse_settings_text(text)


def test_episodes_are_counted_by_what_their_settings_say():
    texts = [
        settings_text(EIGHTH),
        settings_text(Physics()),
        "",
        None,
        json.dumps(asdict(EIGHTH)),
        settings_text(EIGHTH),
    ]
    assert count_settings(texts) == {
        "angular acceleration up to pi/8 rad/s^2": 3,
        "unknown": 2,
        "angular acceleration up to pi/2 rad/s^2": 1,
    }
    other = Physics(angular_acceleration_limit=1.0, step_limit=2000, mass=3.0)
    assert describe_settings(other) == "angular acceleration up to 1.0 rad/s^2, step_limit 2000, mass 3"
