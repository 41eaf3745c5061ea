"""Replay --verify: are the recorded states those of the recorded actions?"""

import json
import math
from dataclasses import replace

import pytest
from straight_carry import record

from copolicy.collect.cli import main
from copolicy.collect.replay.track import read_track
from copolicy.collect.replay.verify import verify
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics


def test_a_recording_of_this_world_is_reproduced(track):
    result = verify(track)
    assert result["reproduced"]
    assert result["exit_status"] == 0
    assert result["max_drift_px"] < 1e-9
    assert result["max_drift_rad"] < 1e-12
    assert result["first_step_beyond"] is None
    assert result["recorded_end"] == result["simulated_end"] == f"goal after {track.steps} steps"


def test_the_bound_of_the_angular_acceleration_is_the_recorded_one(tmp_path):
    config = MapConfig((400.0, 300.0, 1.0), (1000.0, 100.0))
    eighth = Physics(angular_acceleration_limit=math.pi / 8)
    path = record(tmp_path / "eighth.mcap", 90, eighth, config, push=(1.0, 0.2, -1.0, 0.3))
    track = read_track(path)
    result = verify(track)
    assert (result["angular_limit"], result["reproduced"]) == (math.pi / 8, True)
    result = verify(track, "pi/2")
    assert (result["reproduced"], result["exit_status"]) == (False, 1)
    assert result["max_drift_rad"] > 0.01
    assert 0 < result["first_step_beyond"] < 90


def test_a_state_that_the_actions_do_not_lead_to_is_found(track):
    states = track.episode.states.copy()
    states[50:, 0] += 0.02
    bent = replace(track, episode=replace(track.episode, states=states))
    result = verify(bent)
    assert (result["reproduced"], result["first_step_beyond"]) == (False, 50)
    assert result["max_drift_px"] == pytest.approx(0.02)
    assert verify(bent, limit_px=0.05)["reproduced"]


def test_an_end_that_the_world_does_not_see_is_found(track):
    meta = replace(track.episode.meta, termination_reason="collision_obstacle")
    result = verify(replace(track, episode=replace(track.episode, meta=meta)))
    assert result["max_drift_px"] < 1e-9
    assert (result["reproduced"], result["simulated_end"]) == (False, f"goal after {track.steps} steps")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"angular_limit": "pi"}, "angular limit: expected one of ['pi/2', 'pi/8'], found 'pi'"),
        ({"limit_px": 0.0}, "limit in px: expected a positive number, found 0.0"),
    ],
)
def test_limits_that_cannot_be(track, options, text):
    with pytest.raises(InvalidValueError) as caught:
        verify(track, **options)
    assert str(caught.value) == text


def test_the_command_checks_and_its_exit_status_tells(recording, tmp_path, capsys):
    assert main(["replay", str(recording), "--verify", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verify"]["reproduced"] is True
    assert main(["replay", str(recording), "--verify", "--max-drift-px", "1e-300", "--max-drift-rad", "1e-300"]) == 1
    assert "first_step_beyond" in capsys.readouterr().out
    assert main(["replay", str(tmp_path / "none.mcap"), "--verify"]) == 2
    assert "expected a readable MCAP file, found No such file or directory" in capsys.readouterr().err
    record(tmp_path / "empty.mcap", 1)
    assert main(["replay", str(tmp_path / "empty.mcap"), "--verify"]) == 0
