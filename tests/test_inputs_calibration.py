import json
import math

import pytest

from copolicy.collect.inputs import CalibrationRun, CalibrationStore, StickCalibration
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError


def test_a_stick_at_rest_gives_no_force():
    assert StickCalibration(centre=(0.05, -0.02)).force((0.1, -0.05)) == (0.0, 0.0)


def test_the_full_deflection_is_the_full_force_from_an_uneven_range():
    uneven = StickCalibration(centre=(0.1, 0.0), low=(-0.8, -1.0), high=(0.7, 0.9))
    assert uneven.force((0.7, 0.0)) == pytest.approx((1.0, 0.0))
    assert uneven.force((-0.8, 0.0)) == pytest.approx((-1.0, 0.0))
    assert uneven.force((0.1, 0.9)) == pytest.approx((0.0, 1.0))


def test_force_grows_from_zero_at_the_edge_of_the_dead_zone():
    stick = StickCalibration(dead_zone=0.2)
    assert stick.force((0.2, 0.0)) == (0.0, 0.0)
    assert stick.force((0.201, 0.0))[0] == pytest.approx(0.00125)
    assert stick.force((0.6, 0.0))[0] == pytest.approx(0.5)


def test_the_direction_of_a_stick_survives_the_dead_zone():
    x, y = StickCalibration(dead_zone=0.3).force((0.4, 0.2))
    assert math.atan2(y, x) == pytest.approx(math.atan2(0.2, 0.4))


def test_a_corner_stays_within_the_full_force():
    assert StickCalibration().force((1.0, -1.0)) == (1.0, -1.0)


def test_inversion_turns_one_axis():
    assert StickCalibration(invert=(True, False)).force((1.0, 0.0)) == (-1.0, 0.0)
    assert StickCalibration(invert=(False, True)).force((0.0, 1.0)) == (0.0, -1.0)


def test_a_device_with_one_axis_has_no_other():
    assert StickCalibration().force((1.0,)) == (1.0, 0.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"dead_zone": 1.0}, "calibration dead_zone: expected a proportion in [0, 1), found 1.0"),
        (
            {"low": (0.0, -1.0)},
            "calibration: expected low < centre < high, found ((0.0, -1.0), (0.0, 0.0), (1.0, 1.0))",
        ),
        ({"axes": (-1, 0)}, "calibration axes: expected two axis indices, from 0, found (-1, 0)"),
        ({"high": (1.0,)}, "calibration high: expected two finite numbers, found (1.0,)"),
    ],
)
def test_a_calibration_that_cannot_be_is_refused(changes, message):
    with pytest.raises(InvalidValueError) as error:
        StickCalibration(**changes)
    assert str(error.value) == message


def _turn(run, centre, reach, rounds=2.2, steps=80):
    for k in range(round(rounds * steps)):
        angle = 2 * math.pi * k / steps
        run.add((centre[0] + reach * math.cos(angle), centre[1] + reach * math.sin(angle)))


def test_a_calibration_finds_centre_and_range():
    run = CalibrationRun(StickCalibration(invert=(True, False)))
    for k in range(30):
        run.add((0.08 + 0.01 * (k % 2), -0.04))
    assert run.stage == "turn"
    _turn(run, (0.085, -0.04), 0.8)
    assert run.stage == "done"
    calibration = run.result()
    assert calibration.centre == pytest.approx((0.085, -0.04))
    assert calibration.low == pytest.approx((-0.715, -0.84), abs=0.01)
    assert calibration.high == pytest.approx((0.885, 0.76), abs=0.01)
    assert calibration.invert == (True, False)
    assert calibration.dead_zone == 0.1


def test_a_trembling_stick_gets_a_wider_dead_zone():
    run = CalibrationRun(StickCalibration())
    for k in range(30):
        run.add((0.08 * (k % 2), 0.0))
    _turn(run, (0.04, 0.0), 0.6)
    # It trembles by 0.04 around its centre, out of a reach of 0.6.
    assert run.result().dead_zone == pytest.approx(2 * 0.04 / 0.6, abs=0.01)


def test_a_stick_that_is_held_is_not_at_rest():
    run = CalibrationRun(StickCalibration())
    for _ in range(100):
        run.add((0.6, 0.0))
    assert (run.stage, run.progress) == ("rest", 0.0)
    for k in range(29):
        run.add((0.0, 0.0))
        assert run.progress == pytest.approx((k + 1) / 30)
    run.add((0.2, 0.0))  # moved: from the beginning
    assert run.progress == 0.0


def test_a_stick_turned_half_round_is_not_done():
    run = CalibrationRun(StickCalibration())
    for _ in range(30):
        run.add((0.0, 0.0))
    _turn(run, (0.0, 0.0), 1.0, rounds=1.4)
    assert run.stage == "turn"
    assert 0.5 < run.progress < 1


def test_calibrations_are_kept_by_the_kind_of_device(tmp_path):
    folder = tmp_path / "new" / "folder"
    CalibrationStore(folder).put("guid-1", StickCalibration(dead_zone=0.2))
    store = CalibrationStore(folder)
    store.put("guid-2", StickCalibration(invert=(True, True)))
    reread = CalibrationStore(folder)
    assert reread.get("guid-1") == StickCalibration(dead_zone=0.2)
    assert reread.get("guid-2") == StickCalibration(invert=(True, True))
    assert reread.get("another") == StickCalibration()
    assert [path.name for path in folder.iterdir()] == ["calibrations.json"]


@pytest.mark.parametrize(
    ("content", "found"),
    [
        ("{", "Expecting property name"),
        ("[]", "list"),
        (
            '{"guid": {"dead_zone": 0.1}}',
            "expected the entries ['axes', 'centre', 'dead_zone', 'high', 'invert', 'low']",
        ),
    ],
)
def test_a_damaged_file_of_calibrations_is_named(tmp_path, content, found):
    (tmp_path / "calibrations.json").write_text(content, encoding="utf-8")
    with pytest.raises(FileFormatError) as error:
        CalibrationStore(tmp_path)
    assert str(error.value).startswith(f"{tmp_path / 'calibrations.json'}: expected calibrations")
    assert found in str(error.value)


def test_a_calibration_survives_json():
    calibration = StickCalibration((2, 3), (0.1, 0.2), (-0.5, -0.6), (0.7, 0.8), 0.15, (False, True))
    assert StickCalibration.from_json(json.loads(json.dumps(calibration.to_json()))) == calibration
